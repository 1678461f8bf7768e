"""``zv doctor`` finds from outside what a router denies, and certificates that end."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.support.fork_server import ZV
from tests.support.processes import Program
from tests.support.secured import Secured, official, secured
from tests.support.typist import type_zv
from tests.support.waiting import wait_until


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("doctor")


@pytest.fixture(scope="module")
def system(folder: Path) -> Iterator[Secured]:
    """A camera, two nodes with certificates of others, and one that was revoked.

    The recorder publishes no data: what is denied to it is not listed by any router.
    """
    system = secured(folder, days=20)
    stolen = folder / "stolen.json5"
    stolen.touch(0o600)
    stolen.write_bytes(system.file("edge_front").read_bytes())
    system.revoke("edge_front")
    with ExitStack() as running:
        running.enter_context(official(system, folder))
        for name, *words in (
            ("camera", system.file("camera_front")),
            ("camera", system.file("tracker_front"), "--camera", "back"),
            ("recorder", system.file("relay_front"), "--output", folder / "a.mcap"),
            ("edge", stolen),
        ):
            given = [name, "--connect", system.endpoint, "--credentials", *words]
            label = f"{name}{time.monotonic_ns()}"
            program = running.enter_context(Program(given, folder, label, forked=ZV))
            wait_until(lambda program=program: "connected to" in program.complaints, 30)
        yield system


def findings(system: Secured, who: str, *flags: str) -> list[dict[str, Any]]:
    words = ["doctor", "--json", "--for", "1.2", "--connect", system.endpoint, *flags]
    done = type_zv([*words, "--credentials", str(system.file(who))], folder=system.folder)
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.parametrize("who", ["guest", "operator"])
def test_denied_nodes_revoked_sessions_and_ends_are_found_by_anybody_who_sees(
    system: Secured, who: str
):
    found: list[dict[str, Any]] = []

    def complete() -> bool:
        found[:] = [each for each in findings(system, who) if each["level"] != "OK"]
        checks = [(each["level"], each["check"]) for each in found]
        return checks.count(("FAIL", "access")) == 2 and {"health", "validity"} <= {
            check for _, check in checks
        }

    wait_until(complete, 30, lambda: json.dumps(found, indent=1))
    texts = {(each["level"], each["check"]): each for each in found}
    denied = {each["nodes"][0]: each for each in found if each["level"] == "FAIL"}
    assert denied.keys() == {"tracker_front", "relay_front"}
    camera, recorder = denied["tracker_front"], denied["relay_front"]
    assert camera["text"].startswith("tracker_front: the router denies: announce @vision/node/cam")
    assert "publish vision/back/image" in camera["text"]
    assert "zv security check tracker_front @vision/node/camera_back announ" in camera["remedy"]
    assert "announce @vision/node/recorder, " in recorder["text"]
    assert "subscribe vision/*/camera_info" in recorder["text"]
    assert texts["WARN", "access"]["text"].startswith("1 session without any right: tls/127.0.0.1:")
    ends = [each["text"] for each in found if each["check"] == "validity"]
    assert [text.partition(" ends ")[0] for text in ends] == [
        f"the certificate of {who}",
        "the router's certificate",
    ]
    assert all("in 20 days" in text for text in ends)
    (health,) = [each for each in found if each["check"] == "health"]
    assert "the certificate of camera_front ends" in health["text"]


def test_a_node_that_may_not_ask_what_is_denied_does_not_say_that_all_is_well(system: Secured):
    (found,) = [each for each in findings(system, "camera_front") if each["check"] == "access"]
    assert found["level"] == "WARN"
    assert found["text"].startswith("camera_front may not query zenoh-vision/holder/*, @/")
    assert found["text"].endswith(": what is denied is unknown")


def test_a_refused_doctor_says_why(system: Secured, folder: Path):
    other = secured(folder / "other")
    words = ["doctor", "--connect", system.endpoint, "--credentials", str(other.file("guest"))]
    done = type_zv([*words, "--timeout", "2"], folder=folder)
    assert done.returncode == 2
    assert "issued by another authority than that of guest" in done.stdout


@pytest.mark.parametrize(
    ("who", "words", "said"),
    [
        ("guest", ["param", "set", "camera_front", "quality=5"], "query @vision/set/camera_f"),
        ("guest", ["topic", "pub", "vision/front/a", '{"x": 1}'], "publish vision/front/a"),
        ("guest", ["topic", "echo", "other/front/image"], "subscribe other/front/image"),
        ("guest", ["node", "stop", "camera_front"], "query @vision/launch/camera_front"),
        ("camera_front", ["bag", "record", "-o", "no.mcap"], "subscribe vision/*/image"),
        ("camera_front", ["metrics", "--listen", "127.0.0.1:0"], "watch @vision/node/*"),
    ],
    ids=["set", "publish", "another namespace", "stop", "record", "metrics"],
)
def test_a_tool_says_what_its_user_may_not(system: Secured, who: str, words: list[str], said: str):
    given = [*words, "--connect", system.endpoint, "--credentials", str(system.file(who))]
    done = type_zv(given, folder=system.folder)
    assert done.returncode in (1, 2), done.stdout
    assert f"zv: {who} may not {said}" in done.stderr  # and nothing else, which would not be known


def test_a_recording_that_no_trigger_reaches_says_so(system: Secured):
    words = ["bag", "record", "-o", "last.mcap", "--last", "5s", "--for", "500ms", "--connect"]
    for who, told in (("guest", True), ("operator", False)):
        given = [*words, system.endpoint, "--credentials", str(system.file(who))]
        done = type_zv(given, folder=system.folder)
        assert ("so zv bag trigger does not reach it" in done.stderr) == told
