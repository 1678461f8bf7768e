"""The checks of zv doctor that need no network: files, devices, and what mends a loss."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from zenoh_vision.health.counter_change import NOT_LOST
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.messages import Diagnostics, NodeDescription
from zv.registry import SERVICES, model_of
from zv.tools.doctor import remedies
from zv.tools.doctor.machine import device_findings, file_findings, kind_of
from zv.tools.doctor.observation import Observation, router_of
from zv.tools.doctor.streams import loss_findings

ROOT = Path(__file__).parents[4]


def found(*files: Path, zenoh_config: str | None = None) -> list[tuple[str, str, str]]:
    findings = file_findings([str(file) for file in files], zenoh_config)
    return [(finding.level, finding.check, finding.text) for finding in findings]


def written(folder: Path, name: str, text: str) -> Path:
    file = folder / name
    file.write_text(text)
    return file


# Files


def test_the_files_of_the_project_are_right_and_checked_without_being_named(monkeypatch):
    monkeypatch.chdir(ROOT)
    ((level, check, text),) = found()
    assert (level, check) == ("OK", "files")
    for file in ROOT.glob("configs/*.*"):
        assert f"configs/{file.name}" in text


def test_where_there_is_nothing_to_check_that_is_said(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ((level, _, text),) = found()
    assert level == "OK"
    assert "no folder configs/" in text


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("camera.toml", "rate = 2000.0\n", ["rate = 2000.0", "to 1000"]),
        ("my-tracker.toml", "historie = 5\n", ["'historie'", "did you mean 'history'"]),
        ("edge_left.toml", "sigma = \n", ["not TOML", "line 1"]),
        ("up.toml", "[router]\nlisen = 1\n", ["lisen", "did you mean 'listen'"]),
        ("lab.toml", '[[node]]\nservice = "trakker"\n', ["node[0].service", "'tracker'"]),
        ("lab.toml", "[[node]]\nservice = 'edge'\nsettings = { sigma = -1 }\n", ["sigma = -1"]),
        ("other.toml", "colour = 'red'\n", ["colour", "options of no service", "camera, tracker"]),
        ("a.json5", "{ \n mode: 'kraken' }", ["line 2", "mode", "kraken", "`router`"]),
        ("b.json5", "{ mod: 'router' }", ["line 1", "unknown field `mod`", "`listen`"]),
        ("c.json5", "{ mode: ", ["expected"]),
    ],
)
def test_a_file_that_parses_no_more_is_named_with_key_and_what_is_allowed(
    tmp_path, name, text, named
):
    file = written(tmp_path, name, text)
    ((level, check, said),) = found(file)
    assert (level, check) == ("FAIL", "files")
    assert [part for part in (str(file), *named) if part not in said] == []


def test_files_that_are_not_there_fail(tmp_path):
    levels = [level for level, _, _ in found(tmp_path / "no.toml", tmp_path / "no.json5")]
    assert levels == ["FAIL", "FAIL"]


def test_a_mistyped_variable_fails_once_however_many_files_there_are(tmp_path, monkeypatch):
    monkeypatch.setenv("ZV_EDGE_SIGMAA", "3")
    files = [written(tmp_path, f"edge_{n}.toml", "sigma = 2.0\n") for n in range(3)]
    texts = [text for level, _, text in found(*files) if level == "FAIL"]
    assert len(texts) == 1
    assert "ZV_EDGE_SIGMAA" in texts[0]


@pytest.mark.parametrize(
    ("text", "shared"),
    [
        ("{ mode: 'router' }", True),  # Zenoh's default
        ("{ transport: { shared_memory: { enabled: true } } }", True),
        ("{ transport: { shared_memory: { enabled: false } } }", False),
    ],
)
def test_a_zenoh_file_that_leaves_shared_memory_on_is_a_warning(tmp_path, text, shared):
    file = written(tmp_path, "z.json5", text)
    given = found(file)
    assert (("WARN", "memory") in [line[:2] for line in given]) == shared
    also = found(written(tmp_path, "edge.toml", ""), zenoh_config=str(file))
    assert (("WARN", "memory") in [line[:2] for line in also]) == shared


@pytest.mark.parametrize("service", SERVICES)
def test_a_file_without_a_telling_name_is_known_by_its_keys(service):
    keys = dict.fromkeys(set(model_of(service).model_fields) - {"camera", "quality", "max_age"}, 1)
    assert kind_of(Path("mine.toml"), keys) == service


# Losses


def observed(name: str, seconds: float, counters: dict[str, int], **about: object) -> NodeState:
    """Return a node whose counters went from zero to these in so many seconds."""
    description = NodeDescription(
        node=name, service=name.partition("_")[0], cameras=("front",), version="1", host="here",
        pid=1, started_ns=0, **{"publishes": (), "subscribes": (), **about},
    )  # fmt: skip
    reports = tuple(
        Diagnostics(node=name, stamp_ns=0, level=0, message="", uptime_s=uptime_s,
                    counters=counts, rate_hz=30.0, latency_ms={"p50": 1.0, "p99": 1.0})
        for uptime_s, counts in ((0.0, dict.fromkeys(counters, 0)), (seconds, counters))
    )  # fmt: skip
    return NodeState(name, description=description, reports=reports)


@pytest.mark.parametrize("missed", [6, 12])
def test_what_a_camera_lost_is_compared_over_the_consumers_time(missed: int):
    # The camera loses 2 of 30 a second; its reports span 2 s, the tracker's 3 s.
    key = "vision/front/image/compressed"
    lost, arrived = {"dropped.overwritten": 4}, {"received": 90 - missed, "missed": missed}
    camera = observed("camera_front", 2.0, {"captured": 60, **lost}, publishes=(key,))
    tracker = observed("tracker_front", 3.0, arrived, subscribes=(key,))
    found = loss_findings(Observation({}, (), [camera, tracker], {}))
    named = [finding.text.partition(" loses")[0] for finding in found]
    # Six are those that the camera lost itself; six more were lost on the way.
    assert named == ["camera_front", "tracker_front"][: missed // 6]


# Devices


def test_a_machine_without_devices_is_ok_with_a_note(tmp_path):
    (finding,) = device_findings(tmp_path)
    assert finding.level == "OK"
    assert "no video device" in finding.text


@pytest.mark.parametrize("permitted", [True, False])
def test_a_device_is_judged_by_the_permission_to_use_it(tmp_path, monkeypatch, permitted):
    (tmp_path / "dev").mkdir()
    (tmp_path / "dev" / "video0").touch()
    # Root may read everything, so taking the permission away would not do.
    monkeypatch.setattr(os, "access", lambda *_: permitted)
    (finding,) = device_findings(tmp_path)
    assert finding.level == ("OK" if permitted else "WARN")
    assert "/dev/video0" in finding.text
    assert ("usermod -aG video" in finding.remedy) != permitted


# The router's own words


@pytest.mark.parametrize(
    ("said", "version", "sharing"),
    [
        (b'{"version": "v1.10.2-cc83980 built with rustc 1.97", "sessions": []}', "1.10.2", ()),
        (b'{"version": "1.9.0", "sessions": [{"peer": "a1", "shm": true}]}', "1.9.0", ("a1",)),
        (b'{"version": "v1.9.0", "sessions": [{"peer": "a1", "shm": false}]}', "1.9.0", ()),
        (b'{"sessions": null}', None, ()),
        (b"[1, 2]", None, ()),
        (b'{"sessions": [{"shm": true}]}', None, ()),
        (b"\xff", None, ()),
    ],
)
def test_what_a_router_says_in_another_form_is_left_out(said, version, sharing):
    router = router_of("z", said)
    assert (router.version, router.sharing) == (version, sharing)


# What mends a loss


def test_every_reason_of_the_documentation_has_a_remedy():
    text = (ROOT / "docs" / "messages.md").read_text()
    section = text.partition("## What is dropped, and under which name")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \|", section, re.MULTILINE)
    reasons = {reason for reason, where in rows if where != "`zv metrics`"}  # which is no node
    assert reasons - set(NOT_LOST) | {"missed"} == set(remedies.REMEDIES)


@pytest.mark.parametrize("reason", remedies.REMEDIES)
def test_a_parameter_that_is_named_exists(reason):
    remedy = remedies.REMEDIES[reason]
    services = ["camera"] if remedy.of_camera else ["camera", "tracker", "edge"]
    fields = set().union(*(model_of(service).model_fields for service in services))
    assert not remedy.parameter or remedy.parameter in fields


@pytest.mark.parametrize("service", remedies.CHEAPER)
def test_what_makes_a_service_cheaper_are_options_of_it(service):
    assert set(remedies.CHEAPER[service]) <= set(model_of(service).model_fields)
