"""zv node: which nodes run, by their tokens; what each says of itself, by query."""

from __future__ import annotations

import json
import os
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from tests.integration.conftest import some_services
from tests.support.fork_server import ZV
from tests.support.listening import open_client, wait_for_nodes
from tests.support.processes import START_S, Program
from tests.support.standing_in import StandIn
from tests.support.typist import zv
from tests.support.waiting import wait_until

SMALL = ("--width", 160, "--height", 120, "--rate", 5)


@pytest.fixture(scope="module")
def twins(endpoint: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Program]]:
    """Two cameras of one name, and a tracker."""
    with some_services(endpoint, tmp_path_factory.mktemp("nodes")) as start:
        cameras = [start("camera", *SMALL) for _ in range(2)]
        tracker = start("tracker")
        with open_client(endpoint) as session:
            wait_for_nodes(session, "camera_front", "tracker_front")
        wait_until(lambda: len(listed(endpoint)) == 3)
        yield [*cameras, tracker]


def listed(endpoint: str, *arguments: str) -> list[dict[str, Any]]:
    done = zv(endpoint, "node", "list", "--json", *arguments)
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_two_nodes_of_one_name_are_two_lines_with_their_processes(endpoint, twins):
    nodes = listed(endpoint)
    assert [each["node"] for each in nodes] == ["camera_front", "camera_front", "tracker_front"]
    assert {each["pid"] for each in nodes} == {program.process.pid for program in twins}
    assert {each["host"] for each in nodes} == {socket.gethostname()}
    assert all(0 < each["uptime_s"] < 300 for each in nodes)
    assert nodes[2]["subscribes"] == ["vision/front/image/compressed"]
    assert "vision/front/centroid" in nodes[2]["publishes"]


def test_the_table_has_a_line_for_each(endpoint, twins):
    done = zv(endpoint, "node", "list")
    assert done.returncode == 0
    lines = [line.split() for line in done.stdout.splitlines() if "_front" in line]
    assert [line[:2] for line in lines] == [
        ["camera_front", "camera"],
        ["camera_front", "camera"],
        ["tracker_front", "tracker"],
    ]
    assert {line[4] for line in lines} == {str(program.process.pid) for program in twins}


def test_info_says_what_a_node_publishes_and_how_it_does(endpoint, twins):
    done = zv(endpoint, "node", "info", "tracker_front")
    assert done.returncode == 0, done.stderr
    text = " ".join(done.stdout.split())
    assert text.startswith("tracker_front service tracker cameras front version ")
    assert f"pid {twins[2].process.pid} pipeline robust " in text
    assert "publishes vision/front/centroid vision/front/tracks" in text
    assert "subscribes vision/front/image/compressed" in text
    assert "closing = 20 pixels (0 to 255)" in text  # a parameter
    both = zv(endpoint, "node", "info", "camera_*", "--json").stdout.splitlines()
    assert {json.loads(line)["pid"] for line in both} == {
        program.process.pid for program in twins[:2]
    }


def test_a_name_that_nobody_has_is_1_and_the_near_one_is_named(endpoint, twins):
    done = zv(endpoint, "node", "info", "traker_front")
    assert (done.returncode, done.stdout) == (1, "")
    assert "did you mean tracker_front?" in done.stderr


def test_a_namespace_without_nodes_is_1_and_those_with_some_are_named(endpoint, twins):
    done = zv(endpoint, "node", "list", "--namespace", "visoin")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        "zv: no node in namespace visoin: did you mean vision? these exist: vision\n"
    )


@pytest.mark.quiet
def test_a_killed_node_is_gone_within_2_s_and_a_new_one_is_listed(endpoint, tmp_path):
    flags = ["node", "list", "--watch", "--json", "--namespace", "watched"]
    with (
        some_services(endpoint, tmp_path) as start,
        Program([*flags, "--connect", endpoint], tmp_path, "watch", forked=ZV) as watching,
    ):

        def events() -> list[tuple[str, int]]:
            lines = watching.output.rpartition("\n")[0].splitlines()
            return [(e["event"], e["pid"]) for e in map(json.loads, lines)]

        wait_until(lambda: "no node in namespace watched" in watching.complaints, START_S)
        tracker = start("tracker", "--namespace", "watched")
        pid = tracker.process.pid
        wait_until(lambda: events() == [("here", pid)], START_S, lambda: watching.complaints)
        twin = start("tracker", "--namespace", "watched")
        wait_until(lambda: ("here", twin.process.pid) in events(), START_S)
        os.kill(twin.process.pid, signal.SIGKILL)
        wait_until(lambda: ("gone", twin.process.pid) in events(), START_S)
        os.kill(pid, signal.SIGKILL)
        killed_s = time.monotonic()
        wait_until(lambda: ("gone", pid) in events(), START_S)
        assert time.monotonic() - killed_s < 2
        assert watching.interrupt() == 0
        assert len(events()) == 4


def test_parameters_are_shown_if_the_node_answers_for_them(endpoint):
    with open_client(endpoint) as session:
        node = StandIn(
            session,
            "edge_front",
            namespace="tuned",
            parameters={"sigma": {"value": 2.0, "minimum": 0.0, "maximum": 20.0, "unit": "px"}},
        )
        done = zv(endpoint, "node", "info", "edge_front", "--namespace", "tuned")
        record = zv(endpoint, "node", "info", "edge_front", "--namespace", "tuned", "--json")
        del node
    assert "  parameters  sigma = 2.0 px (0 to 20)" in done.stdout.splitlines()
    assert json.loads(record.stdout)["parameters"][0]["maximum"] == 20.0


def test_a_node_that_does_not_answer_is_listed_so(endpoint):
    with open_client(endpoint) as session:
        node = StandIn(session, "edge_front", namespace="dumb", answers=False)
        done = zv(endpoint, "node", "list", "--namespace", "dumb")
        del node
    assert done.returncode == 0
    assert "does not answer" in done.stdout


def test_of_many_nodes_only_the_one_that_leaves_is_reported(endpoint, tmp_path):
    flags = ["node", "list", "--watch", "--namespace", "crowd"]
    names = [f"edge_n{n}" for n in range(8)]
    with (
        ExitStack() as sessions,
        Program([*flags, "--connect", endpoint], tmp_path, "watch", forked=ZV) as watching,
    ):
        nodes = {}
        for name in names:
            session = sessions.enter_context(open_client(endpoint))
            nodes[name] = session, StandIn(session, name, namespace="crowd")
        watching.lines(r"here  edge_n\d  edge 0.1.0 on elsewhere, pid \d+", count=8)
        for gone, name in enumerate(names[:4]):
            nodes[name][0].close()
            watching.lines(r"gone  edge_n\d .*", count=gone + 1)
        assert watching.interrupt() == 0
        lines = watching.output.splitlines()
        assert [line.split()[1] for line in lines[8:]] == names[:4]
