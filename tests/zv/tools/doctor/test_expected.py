"""Which nodes of a launch file zv doctor misses."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.diagnosing import observation
from tests.support.node_states import node_state
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.transport.connection import Connection
from zv.launcher.launch_file import read_launch_file
from zv.tools.doctor.command import _of_plan, expected_plan
from zv.tools.doctor.network import expected_findings
from zv.tools.doctor.options import DoctorOptions

ROOT = Path(__file__).parents[4]


def test_the_nodes_of_a_launch_file_that_do_not_run_are_named():
    plan = read_launch_file(ROOT / "configs" / "up.toml")
    running = [node_state(name) for name in ("camera_front", "viewer")]
    dead = NodeState("edge_front", has_token=True)
    findings = expected_findings(observation(*running, dead), plan)
    assert [(each.level, each.nodes) for each in findings] == [
        ("FAIL", ("tracker_front",)),
        ("FAIL", ("edge_front",)),
    ]
    assert findings[0].text == f"tracker_front of {plan.place} does not run"
    names = ("camera_front", "tracker_front", "edge_front", "viewer")
    (well,) = expected_findings(observation(*map(node_state, names)), plan)
    assert (well.level, well.text) == ("OK", f"all 4 nodes of {plan.place} run")


def test_a_program_of_a_launch_file_that_announces_no_node_is_not_checked(tmp_path):
    table = '[[node]]\nservice = "{}"\ncommand = ["true"]\n'
    file = tmp_path / "up.toml"
    file.write_text("".join(map(table.format, ("mine", "stuck", "well"))))
    plan = read_launch_file(file)
    stuck = NodeState("stuck", has_token=True)
    findings = expected_findings(observation(node_state("well"), stuck), plan)
    assert [(each.level, each.text) for each in findings] == [
        ("WARN", f"mine of {file} announces no node: not checked"),
        ("FAIL", f"stuck of {file} does not run"),
    ]


def test_the_cameras_of_an_expected_file_are_renamed_as_by_zv_up():
    file = str(ROOT / "configs" / "up.toml")
    plan = expected_plan(DoctorOptions(expect=file, remap=("front=left",)))
    assert plan is not None
    names = ["camera_left", "tracker_left", "edge_left", "viewer"]
    assert [node.name for node in plan.nodes] == names
    with pytest.raises(ConfigurationError, match="give --expect too"):
        expected_plan(DoctorOptions(remap=("front=left",)))
    assert expected_plan(DoctorOptions()) is None


def test_an_expected_file_names_the_router_and_the_namespace_unless_others_are_given(tmp_path):
    file = tmp_path / "lab.toml"
    file.write_text(
        'namespace = "lab"\n[router]\nlisten = "tcp/0.0.0.0:7555"\n[[node]]\nservice = "edge"\n'
    )
    plan = read_launch_file(file)
    of_file = Connection("tcp/127.0.0.1:7555", "lab", timeout_s=5)
    assert _of_plan(Connection(timeout_s=5), plan) == of_file
    given = Connection("tcp/10.0.0.1:7447", "roof", timeout_s=5)
    assert _of_plan(given, plan) == given
