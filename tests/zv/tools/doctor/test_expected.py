"""Which nodes of a launch file zv doctor misses."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.diagnosing import observation
from tests.support.node_states import node_state
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.transport.connection import Connection
from zv.tools.doctor.expected import Expectation, expectation
from zv.tools.doctor.options import DoctorOptions

ROOT = Path(__file__).parents[4]


UP = str(ROOT / "configs" / "up.toml")


def of_file(file: object = UP, connection: Connection | None = None, *remap: str) -> Expectation:
    options = DoctorOptions(expect=str(file), remap=remap)
    found = expectation(options, connection or Connection())
    assert found is not None
    return found


def test_the_nodes_of_a_launch_file_that_do_not_run_are_named_with_their_commands():
    running = [node_state(name) for name in ("camera_front", "viewer")]
    dead = NodeState("edge_front", has_token=True)
    tracker, edge = of_file(connection=Connection("tcp/10.0.0.1:7447", "roof")).findings(
        observation(*running, dead)
    )
    assert (tracker.level, tracker.nodes) == ("FAIL", ("tracker_front",))
    assert tracker.text == f"tracker_front of {UP} does not run"
    assert tracker.remedy == (
        "it was not started, or its log says why it ended; "
        "zv tracker --camera front --connect tcp/10.0.0.1:7447 --namespace roof"
    )
    assert (edge.level, edge.text) == ("FAIL", f"edge_front of {UP} does not answer")
    names = ("camera_front", "tracker_front", "edge_front", "viewer")
    (well,) = of_file().findings(observation(*map(node_state, names)))
    assert (well.level, well.text) == ("OK", f"all 4 nodes of {UP} run")


def test_the_command_of_a_node_has_the_settings_of_the_file_and_no_secret(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a b.mp4").touch()
    file = Path("up.toml")
    file.write_text(
        '[[node]]\nservice = "tracker"\n'
        '[[node]]\nservice = "camera"\nsettings = { source = "a b.mp4", loop = true }\n'
        '[[node]]\nservice = "viewer"\nsettings = { token = "sixteen-letters-secret" }\n'
    )
    camera, viewer = of_file(file).findings(observation(node_state("tracker_front")))
    assert camera.remedy.endswith("; zv camera --camera front --source 'a b.mp4' --loop")
    assert viewer.remedy.endswith("; ZV_VIEWER_TOKEN=... zv view")


def test_where_nothing_of_the_file_runs_one_command_starts_all_with_the_router_that_runs():
    other = observation(node_state("camera_front"))
    (finding,) = of_file(UP, None, "front=left").findings(other)
    assert finding.text == f"nothing of {UP} runs: camera_left, tracker_left, edge_left, viewer"
    assert finding.remedy == f"zv up {UP} --remap front=left --connect tcp/127.0.0.1:7447"


def test_where_there_is_no_router_the_file_that_starts_it_is_named(tmp_path):
    assert of_file().router_remedy == f"nothing of {UP} runs; zv up {UP} starts all of it"
    assert of_file(connection=Connection("tcp/10.0.0.1:7447")).router_remedy == ""
    file = tmp_path / "up.toml"
    file.write_text('[router]\nconnect = "tcp/10.0.0.1:7447"\n[[node]]\nservice = "edge"\n')
    assert of_file(file).router_remedy == ""


def test_a_program_of_a_launch_file_that_announces_no_node_is_not_checked(tmp_path):
    table = '[[node]]\nservice = "{}"\ncommand = ["true"]\n'
    file = tmp_path / "up.toml"
    file.write_text("".join(map(table.format, ("mine", "stuck", "well"))))
    stuck = NodeState("stuck", has_token=True)
    findings = of_file(file).findings(observation(node_state("well"), stuck))
    assert [(each.level, each.text) for each in findings] == [
        ("WARN", f"mine of {file} announces no node: not checked"),
        ("FAIL", f"stuck of {file} does not answer"),
    ]


def test_the_cameras_of_an_expected_file_are_renamed_as_by_zv_up():
    names = ["camera_left", "tracker_left", "edge_left", "viewer"]
    assert [node.name for node in of_file(UP, None, "front=left").plan.nodes] == names
    with pytest.raises(ConfigurationError, match="give --expect too"):
        expectation(DoctorOptions(remap=("front=left",)), Connection())
    assert expectation(DoctorOptions(), Connection()) is None


def test_an_expected_file_names_the_router_and_the_namespace_unless_others_are_given(tmp_path):
    file = tmp_path / "lab.toml"
    file.write_text(
        'namespace = "lab"\n[router]\nlisten = "tcp/0.0.0.0:7555"\n[[node]]\nservice = "edge"\n'
    )
    here = Connection("tcp/127.0.0.1:7555", "lab", timeout_s=5)
    assert of_file(file, Connection(timeout_s=5)).connection == here
    given = Connection("tcp/10.0.0.1:7447", "roof", timeout_s=5)
    assert of_file(file, given).connection == given
