"""zv top: the figures of all nodes, those that hurt first, on a terminal and elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from tests.integration.conftest import a_router
from tests.support.fork_server import ZV
from tests.support.listening import open_client
from tests.support.processes import START_S, Program
from tests.support.standing_in import StandIn
from tests.support.terminal import Terminal
from tests.support.typist import zv
from tests.support.waiting import wait_until


@pytest.fixture(scope="module")
def hurting(endpoint: str) -> Iterator[None]:
    """Three nodes: one well, one that loses frames, one in error."""
    with ExitStack() as sessions:
        kept = [
            StandIn(sessions.enter_context(open_client(endpoint)), node, **about)
            for node, about in {
                "a_well": {"namespace": "hurts"},
                "b_losing": {
                    "namespace": "hurts",
                    "counters": lambda s: {"received": int(10 * s), "dropped.stale": int(2 * s)},
                },
                "c_error": {
                    "namespace": "hurts",
                    "health": {"level": 2, "message": "no source"},
                },
            }.items()
        ]
        yield
        kept.clear()


def test_top_once_shows_those_that_hurt_first(endpoint, hurting):
    done = zv(endpoint, "top", "--once", "--namespace", "hurts")
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()]
    nodes = [row for row in rows if row and row[0] in ("a_well", "b_losing", "c_error")]
    assert [row[:2] for row in nodes] == [
        ["c_error", "ERROR"],
        ["b_losing", "running"],
        ["a_well", "running"],
    ]
    assert "20.0" in nodes[1]  # percent lost
    assert "c_error: no source" in done.stdout
    assert "\x1b" not in done.stdout


def test_top_in_a_pipe_is_lines_until_ctrl_c(endpoint, hurting, tmp_path):
    flags = ["top", "--namespace", "hurts", "--every", "300ms"]
    with Program([*flags, "--connect", endpoint], tmp_path, "top", forked=ZV) as top:
        top.lines(r"c_error +ERROR .*\(no source\)", count=2)
        top.lines(r"hurts at tcp/.*: 3 nodes, 1 ERROR")
        assert top.interrupt() == 0
        assert top.complaints == ""


def test_top_on_a_terminal_is_a_table_until_ctrl_c(endpoint, hurting):
    terminal = Terminal(["top", "--namespace", "hurts", "--connect", endpoint], columns=120)
    # At the first look there is nothing to compare with.
    text = terminal.until(lambda text: 0 < text.rfind("b_losing") < text.rfind("a_well"))
    assert text.rfind("c_error  ERROR") < text.rfind("b_losing")
    assert "Ctrl-C ends it" in text
    terminal.press_ctrl_c()
    assert terminal.end() == 0
    assert "Traceback" not in terminal.text


def test_top_once_without_a_node_is_1(endpoint, hurting):
    done = zv(endpoint, "top", "--once", "--namespace", "hurtz")
    assert (done.returncode, done.stdout) == (1, "")
    assert "no node in namespace hurtz" in done.stderr


def test_top_waits_for_a_router_that_goes_and_comes_back(tmp_path):
    with a_router(tmp_path) as router:
        flags = ["top", "--every", "300ms", "--connect", router.endpoint]
        with Program(flags, tmp_path, "top", forked=ZV) as top:
            top.lines(r"no node in namespace vision")
            router.kill()
            top.lines(r"no router at tcp/.*, waiting for it")
            router.start()
            before = top.output.count("no node in")
            wait_until(lambda: top.output.count("no node in") > before, START_S)
            assert top.interrupt() == 0
