"""The frame that all tools share: flags from a model, streams, signals, statuses, completion."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.support.processes import ROOT, STOP_S, Program, environment
from tests.support.systems import running_router
from tests.support.typist import type_zv
from tests.support.waiting import wait_until
from zenoh_vision.host.signals import SIGNALS
from zenoh_vision.transport.connection import Connection
from zv.cli.completion import typed_so_far
from zv.cli.loading import run_tool
from zv.cli.main import COMMANDS
from zv.tools import registry
from zv.tools.shared.discovery import nothing_matches
from zv.tools.shared.options import ToolOptions
from zv.tools.shared.output import Output

TOOL = str(ROOT / "tests" / "support" / "programs" / "count_tool.py")


def zv(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return type_zv(arguments, program="tests.support.programs.count_tool", **variables)


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with running_router(tmp_path_factory.mktemp("router")) as endpoint:
        yield endpoint


def test_every_tool_and_group_of_the_catalogue_is_a_command():
    first_words = {words.split()[0] for words in registry.TOOLS}
    assert first_words <= set(COMMANDS)
    assert set(registry.GROUPS) == {w.split()[0] for w in registry.TOOLS if " " in w}


def test_flags_units_shares_and_arguments_arrive_as_the_model_says():
    told = ["options", "a", "b", "--for", "500ms", "--off", "5%", "-o", "x", "--no-header"]
    done = zv("count", "up", *told)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {
        "what": "options",
        "more": ["a", "b"],
        "for_": 0.5,
        "off": 0.05,
        "output": "x",
        "loud": False,
        "header": False,
        "timeout": 5.0,
    }


@pytest.mark.parametrize(
    ("arguments", "named"),
    {
        "unit": (["x", "--for", "5parsec"], ["--for", "'5parsec'", "5, 5s, 500ms, 2m"]),
        "range": (["x", "--off", "200%"], ["--off", "'200%'", "at least 0 and below 1"]),
        "missing argument": ([], ["WHAT"]),
        "unknown flag": (["x", "--fro", "5s"], ["--fro", "--for"]),
        "no endpoint": (["x", "--connect", "here"], ["--connect", "tcp"]),
    }.values(),
    ids=str,
)
def test_wrong_use_is_2_and_says_what_is_allowed(arguments, named):
    done = zv("count", "up", *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert [text for text in named if text not in done.stderr] == [], done.stderr


def test_a_command_that_is_mistyped_in_a_group_is_2_and_the_near_one_is_named():
    done = zv("count", "upp")
    assert done.returncode == 2
    assert "did you mean up?" in done.stderr


def test_a_group_alone_shows_its_commands_and_loads_none():
    done = zv("count", "--help")
    assert "Count up." in done.stdout
    assert "zv count up sheep --for 5s" in " ".join(done.stdout.split())


def test_an_expectation_that_is_not_met_is_1_and_one_line():
    done = zv("count", "up", "nothing")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        "zv: nothing matches tree: did you mean trees? these exist: stones, trees\n"
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda n: n.name)
def test_a_signal_ends_a_tool_with_0(endpoint, tmp_path, number):
    with Program([TOOL, "count", "up", "sheep", "--connect", endpoint], tmp_path, "t") as program:
        program.lines(r"\d+ sheep", count=3)
        program.process.send_signal(number)
        assert program.process.wait(2) == 0
        assert program.complaints == "zv: counting\n"
        assert program.output.splitlines()[-1].endswith(" sheep")


def test_a_signal_at_the_very_end_does_not_change_the_status():
    before = {number: signal.getsignal(number) for number in SIGNALS}
    try:
        run_tool(lambda *_: None, ToolOptions(), Connection(), Output())
        assert [signal.getsignal(number) for number in SIGNALS] == [signal.SIG_IGN] * 2
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_a_reader_that_leaves_ends_a_tool_with_0_and_without_a_word(endpoint):
    running = subprocess.Popen(
        [sys.executable, TOOL, "count", "up", "sheep", "--connect", endpoint],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        env=environment(),
    )
    assert running.stdout is not None
    assert running.stderr is not None
    running.stdout.readline()
    running.stdout.close()
    assert running.wait(10) == 0
    assert running.stderr.read() == "zv: counting\n"
    running.stderr.close()


def test_a_table_in_a_pipe_has_no_colour_and_breaks_no_line(endpoint, tmp_path):
    long = "sheep" * 60
    flags = ["count", "up", long, "--json", "--connect", endpoint]
    with Program([TOOL, *flags], tmp_path, "t") as program:
        wait_until(lambda: long in program.output, explain=lambda: program.complaints)
        assert program.process.wait(STOP_S) == 0
    (row,) = [line for line in program.output.splitlines() if long in line]
    assert row.split() == [long, "1", "-"]
    assert "\x1b" not in program.output


@pytest.mark.parametrize(
    ("existing", "said"),
    [
        ([], "nothing matches a/b: there is no key at all; is a node running?"),
        (["c/d"], "nothing matches a/b: these exist: c/d"),
        (["a/bb", "z"], "nothing matches a/b: did you mean a/bb? these exist: a/bb, z"),
    ],
)
def test_what_exists_is_named_and_the_nearest_of_it(existing, said):
    assert nothing_matches("a/b", existing) == said


def test_of_many_names_the_nearest_dozen_is_shown():
    said = nothing_matches("vision/front/image", [f"k{n}" for n in range(30)] + ["vision/front/i"])
    assert "did you mean vision/front/i?" in said
    assert said.endswith("and 19 more")


@pytest.mark.parametrize(
    ("typed", "kind"),
    [
        ("topic echo", "key"),
        ("topic echo --once", "key"),
        ("topic echo --field x", "key"),
        ("topic echo --field=x", "key"),
        ("topic hz a/b", "key"),
        ("topic echo a/b", ""),
        ("topic pub", "key"),
        ("topic pub a/b", ""),
        ("snapshot", "key"),
        ("node info", "node"),
        ("param get", "node"),
        ("param get camera_front", "parameter"),
        ("param get camera_front rate flip", "parameter"),
        ("param set camera_front", "parameter"),
        ("param set camera_front flip", "value"),
        ("param set camera_front flip=none", "parameter"),
        ("param set camera_front flip=none loop", "value"),
        ("param set camera_front flip none", "parameter"),
        ("param set camera_front flip none loop", "value"),
        ("param dump camera_front", ""),
        ("param load camera_front", ""),
        ("--connect X param get", "node"),
        ("param --connect X get --namespace=lab", "node"),
        ("schema", ""),
    ],
)
def test_the_next_argument_of_a_line_is_known(typed: str, kind: str):
    found = typed_so_far(typed.split())
    assert found is not None
    assert found.kind() == kind


@pytest.mark.parametrize(
    "typed", ["", "topic", "camera", "topic echo --field", "--connect", "--bogus topic echo"]
)
def test_other_lines_are_completed_by_their_commands(typed: str):
    assert typed_so_far(typed.split()) is None


def test_the_connection_is_taken_from_the_line():
    found = typed_so_far(["--connect", "X", "param", "get", "--namespace=lab", "n"])
    assert found is not None
    assert found.connection == {"--connect": "X", "--namespace": "lab"}
    assert found.arguments == ["n"]
