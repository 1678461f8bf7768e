"""Nodes that are programs of the user's own: what the launch file says, and real processes."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from tests.support.processes import ROOT
from tests.support.waiting import wait_until
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.transport.connection import Connection
from zv.launcher import group_guard
from zv.launcher.child import Child
from zv.launcher.command_line import program_command_line
from zv.launcher.group_guard import GroupGuard
from zv.launcher.launch_file import PlannedProgram, read_launch_file, remapped_cameras
from zv.status.process_usage import ProcessUsage

SH = '[[node]]\nservice = "mine"\ncommand = "sh -c true"\n'


def launch(folder: Path, text: str) -> Path:
    path = folder / "up.toml"
    path.write_text(text)
    return path


def planned(folder: Path, text: str) -> PlannedProgram:
    (node,) = read_launch_file(launch(folder, text)).nodes
    assert isinstance(node, PlannedProgram)
    return node


# The launch file


@pytest.mark.parametrize(
    "command",
    ["""'sh -c "echo $HOME" *'""", '["sh", "-c", "echo $HOME", "*"]'],
    ids=["text", "list"],
)
def test_a_command_is_words_in_which_nothing_is_expanded(tmp_path, command):
    node = planned(tmp_path, f'[[node]]\nservice = "mine"\ncommand = {command}\n')
    assert node.words[1:] == ("-c", "echo $HOME", "*")
    assert Path(node.words[0]).name == "sh"
    assert (node.name, node.folder, node.restart) == ("mine", tmp_path, True)


def test_the_documented_example_is_started_as_its_comments_say(tmp_path):
    page = (ROOT / "docs" / "configuration.md").read_text()
    example = page.partition("### A program of your own")[2].partition("```toml\n")[2]
    (tmp_path / "brightness.toml").touch()
    node = planned(tmp_path, example.partition("```")[0])
    assert node.name == "brightness_front"
    assert node.words[1:] == (
        "brightness.py",
        "--camera=front",
        f"--config={tmp_path / 'brightness.toml'}",
        "--gain=2.0",
        "--loop",
        "--zone=a",
        "--zone=b",
    )
    assert node.variables == {"OMP_NUM_THREADS": "1"}


def test_false_is_a_flag_and_a_value_that_begins_with_a_dash_stays_a_value(tmp_path):
    node = planned(tmp_path, SH + 'settings = { draw_all = false, offset = -3, file = "-1.avi" }\n')
    assert node.words[3:] == ("--no-draw-all", "--offset=-3", "--file=-1.avi")


def test_a_program_with_a_slash_is_found_from_its_working_directory(tmp_path):
    (tmp_path / "bin").mkdir()
    script = tmp_path / "bin" / "run.sh"
    script.write_text("#!/bin/sh\n")
    script.chmod(0o755)
    text = '[[node]]\nservice = "mine"\ncommand = "./run.sh"\ncwd = "bin"\n'
    node = planned(tmp_path, text)
    assert (Path(node.words[0]).resolve(), node.folder) == (script, tmp_path / "bin")


def test_python_is_the_one_that_runs_zv_unless_an_environment_is_active(tmp_path, monkeypatch):
    other = tmp_path / "python"
    other.write_text("#!/bin/sh\n")
    other.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    text = '[[node]]\nservice = "mine"\ncommand = "python x.py"\n'
    monkeypatch.delenv("VIRTUAL_ENV", raising=False)
    assert planned(tmp_path, text).words[0] == str(Path(sys.executable).parent / "python")
    monkeypatch.setenv("VIRTUAL_ENV", "/active")
    assert planned(tmp_path, text).words[0] == str(other)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('command = "nosuch x.py"\n', ["node[0].command", "mine", "'nosuch' on PATH"]),
        ('command = "./nosuch"\n', ["node[0].command", "mine", "there is no file", "/nosuch"]),
        ('command = "./up.toml"\n', ["node[0].command", "mine", "up.toml is not executable"]),
        ('command = ""\n', ["node[0].command", "mine", "it is empty"]),
        ("command = []\n", ["node[0].command", "mine", "it is empty"]),
        ("command = 'sh -c \"'\n", ["node[0].command", "no closing quotation", "a list"]),
        ("command = 3\n", ["node[0].command = 3", "a list of its arguments"]),
        ('command = ["sh", 3]\n', ["node[0].command[1] = 3", "a list of its arguments"]),
        ('command = "sh"\nenv = { A = true }\n', ["node[0].env.A = True", "environment variables"]),
        ('command = "sh"\nenv = { "A B" = "" }\n', ["node[0].env.A B", "environment variables"]),
        ('command = "sh"\nenv = { A = "\\u0000" }\n', ["node[0].env.A", "NUL"]),
        ('command = "sh"\ncwd = "nosuch"\n', ["node[0].cwd = 'nosuch'", "there is no folder"]),
        ('command = "sh"\ncwdd = "x"\n', ["node[0].cwdd", "did you mean 'cwd'?", "restart"]),
        ('command = "sh"\nsettings = { a = { b = 1 } }\n', ["settings.a", "a text, a number"]),
        ('command = "sh"\nsettings = { "a b" = 1 }\n', ["settings", "'a b'", "become flags"]),
        ('command = "sh"\nsettings = { camera = "x" }\n', ["settings.camera", "beside settings"]),
        ('command = "sh"\nconfig = "nosuch.toml"\n', ["node[0].config", "there is no file"]),
    ],
)
def test_a_wrong_command_is_refused_naming_file_node_key_and_what_is_allowed(tmp_path, text, said):
    path = launch(tmp_path, '[[node]]\nservice = "mine"\n' + text)
    with pytest.raises(ConfigurationError) as caught:
        read_launch_file(path)
    message = str(caught.value)
    assert all(words in message for words in [str(path), "allowed:", *said]), message


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('service = "My Node"\ncommand = "sh"\n', ["node[0].service = 'My Node'", "[a-z0-9_]+"]),
        ('service = "router"\ncommand = "sh"\n', ["node[0].service = 'router'", "of your own"]),
        ('service = "mine"\n', ["node[0].service = 'mine'", "with command = ..."]),
        ('service = "edge"\nenv = { A = "1" }\n', ["node[0].env", "with command = ..."]),
        ('service = "edge"\ncwd = "."\n', ["node[0].cwd", "with command = ..."]),
    ],
)
def test_a_name_of_ones_own_needs_a_command_and_a_service_of_zv_takes_none(tmp_path, text, said):
    with pytest.raises(ConfigurationError) as caught:
        read_launch_file(launch(tmp_path, "[[node]]\n" + text))
    assert all(words in str(caught.value) for words in said), caught.value


# Remapping

THREE = """[[node]]
service = "camera"
[[node]]
service = "viewer"
[[node]]
service = "mine"
command = "sh"
camera = "front"
[[node]]
service = "other"
command = "sh"
"""


def test_a_remapped_camera_is_renamed_in_every_node_that_has_it(tmp_path):
    nodes = read_launch_file(launch(tmp_path, THREE + '[remap]\nfront = "left"\n')).nodes
    assert [node.name for node in nodes] == ["camera_left", "viewer", "mine_left", "other"]
    assert nodes[2].words[1:] == ("--camera=left",)
    assert nodes[3].words[1:] == ()


def test_a_flag_overrides_the_table_and_two_cameras_can_be_swapped(tmp_path):
    two = '[[node]]\nservice = "edge"\ncamera = "back"\n'
    path = launch(tmp_path, THREE + two + '[remap]\nfront = "left"\n')
    nodes = read_launch_file(path, remapped_cameras(["front=back", "back=front"])).nodes
    assert [node.name for node in nodes] == [
        "camera_back", "viewer", "mine_back", "other", "edge_front"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("table", "flags", "said"),
    [
        ('[remap]\nfornt = "x"\n', [], ["remap.fornt", "did you mean 'front'?"]),
        ('[remap]\n"Front!" = "x"\n', [], ["remap.Front!", "OLD = "]),
        ('[remap]\nfront = "X!"\n', [], ["remap.front = 'X!'", "OLD = "]),
        ("remap = 3\n", [], ["remap = 3", "OLD = "]),
        ("", ["side=x"], ["--remap side", "no node has this camera", "allowed: front"]),
        (
            "",
            ["front"],
            [
                "--remap = 'front' is not allowed; allowed: OLD=NEW, two names of cameras: "
                "letters a-z, digits and _, at most 64 characters"
            ],
        ),
        ("", ["front:=x"], ["--remap = 'front:=x'", "OLD=NEW"]),
        ("", ["front=" + "x" * 65], ["--remap = 'front=xxx", "digits and _, at most 64"]),
        ("", ["front=x", "front=y"], ["--remap = 'front=y'", "given before"]),
    ],
)
def test_a_wrong_remapping_is_refused(tmp_path, table, flags, said):
    with pytest.raises(ConfigurationError) as caught:
        read_launch_file(launch(tmp_path, table + THREE), remapped_cameras(flags))
    assert all(words in str(caught.value) for words in said), caught.value


def test_two_cameras_cannot_become_one(tmp_path):
    two = '[[node]]\nservice = "camera"\ncamera = "back"\n'
    with pytest.raises(ConfigurationError, match="already a camera for back"):
        read_launch_file(launch(tmp_path, THREE + two), {"front": "back"})


@pytest.mark.parametrize(
    ("one", "other", "said"),
    [
        ("left", "left,right", "already a tracker for left"),
        ("left", "*", "already a tracker for all cameras"),
        ("left,right", "front,back", "already a node called tracker"),
    ],
)
def test_two_trackers_do_not_serve_one_camera(tmp_path, one, other, said):
    two = "".join(f'[[node]]\nservice = "tracker"\ncamera = "{each}"\n' for each in (one, other))
    with pytest.raises(ConfigurationError, match=said):
        read_launch_file(launch(tmp_path, two))


# Processes

Start = Callable[..., Child]


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def start(tmp_path: Path, said: list[str]) -> Iterator[Start]:
    """Starts a program that ``sh`` runs as node ``mine_front``."""
    guard = GroupGuard()
    started = []

    def begin(script: str, **variables: str) -> Child:
        connection = Connection("tcp/127.0.0.1:7000", "robot1", "tls.json5")
        words = ["/bin/sh", "-c", script]
        line = program_command_line("mine_front", words, variables, tmp_path, connection)
        child = Child("mine_front", line, say=said.append, finishes=True, guard=guard)
        started.append(child)
        child.start()
        return child

    yield begin
    for child in started:
        child.terminate()
        child.finish(time.monotonic() + 1)
    guard.close()


def until_ended(child: Child) -> None:
    wait_until(lambda: child.check() or child.exit_status is not None)


def alive(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def pids(said: list[str]) -> list[int]:
    """Return the process ids that a program has printed."""
    return [int(line.rpartition(" ")[2]) for line in said if line.startswith("mine_front: pid ")]


def test_a_program_learns_router_namespace_and_its_name_and_where_it_runs(
    start, said, tmp_path, monkeypatch
):
    monkeypatch.setenv("ZV_TIMEOUT", "3")  # of zv up itself
    script = (
        "echo $ZV_CONNECT $ZV_NAMESPACE $ZV_NODE $ZV_TIMEOUT.; pwd; echo $MINE $ZV_ZENOH_CONFIG"
    )
    until_ended(start(script, MINE="my own"))
    wait_until(lambda: len(said) >= 4)
    assert sorted(said) == sorted(
        [
            "mine_front: tcp/127.0.0.1:7000 robot1 mine_front .",
            f"mine_front: {tmp_path}",
            f"mine_front: my own {Path('tls.json5').absolute()}",
            "mine_front has finished",
        ]
    )


def test_what_a_program_prints_is_shown_with_its_name_on_either_stream(start, said):
    until_ended(start("echo out; echo err >&2; head -c 5000 /dev/zero | tr '\\0' x"))
    wait_until(lambda: len(said) == 5)
    lines = sorted(line.removeprefix("mine_front: ") for line in said)
    assert lines == ["err", "mine_front has finished", "out", "x" * 904, "x" * 4096]


def test_a_program_runs_and_ends_even_if_its_guard_cannot_be_started(start, said, monkeypatch):
    monkeypatch.setattr(group_guard.sys, "executable", "/nonexistent")
    child = start("echo pid $$; sleep 60")
    (warning,) = [line for line in said if "would outlive" in line]
    assert warning.startswith("mine_front would outlive a killed zv up: ")
    assert warning.endswith("cannot be started: No such file or directory")
    wait_until(lambda: pids(said))
    child.terminate()
    child.finish(time.monotonic() + 1)
    assert (child.state, alive(pids(said)[0])) == ("stopped", False)


def test_the_status_of_a_program_means_nothing_but_0_and_2(start, said):
    child = start("exit 3")
    until_ended(child)
    assert said == ["mine_front ended with status 3, starting again in 1 s"]
    child = start("exit 2")
    until_ended(child)
    assert (said[-1], child.state) == (
        "mine_front ended with status 2, not starting again",
        "failed",
    )
    child = start("exit 0")
    until_ended(child)
    assert child.state == "finished"


def test_a_program_that_ignores_the_request_is_killed_with_its_children(start, said):
    child = start("trap '' TERM; sleep 60 & echo pid $!; echo pid $$; wait; sleep 60")
    wait_until(lambda: len(pids(said)) == 2)
    child.terminate()
    child.finish(time.monotonic() + 0.2)
    wait_until(lambda: not any(map(alive, pids(said))))
    assert "mine_front did not end in time: killed" in said
    assert child.state == "stopped"


def test_a_child_that_outlives_its_program_at_the_end_is_killed(start, said):
    child = start("trap 'exit 0' TERM; (trap '' TERM; sleep 60) & echo pid $!; wait")
    wait_until(lambda: pids(said))
    child.terminate()
    child.finish(time.monotonic() + 0.3)
    wait_until(lambda: not any(map(alive, pids(said))))


def test_what_a_program_has_started_ends_when_the_program_dies(start, said):
    child = start("sleep 60 & echo pid $!; wait")
    wait_until(lambda: pids(said))
    os.kill(child.pid, signal.SIGKILL)
    until_ended(child)
    wait_until(lambda: not any(map(alive, pids(said))))
    assert "mine_front died (signal 9), starting again in 1 s" in said


def test_a_program_that_is_gone_when_it_is_started_again_is_tried_later(tmp_path, said):
    line = program_command_line("x", [str(tmp_path / "gone")], {}, tmp_path, Connection())
    child = Child("x", line, say=said.append, guard=GroupGuard())
    child.start()
    assert said == [
        f"x: {tmp_path / 'gone'}: No such file or directory",
        "x ended with status 127, starting again in 1 s",
    ]


def test_cpu_and_memory_include_what_a_program_has_started(start, said):
    hold = "import time; x = bytearray(80_000_000); print('pid 1', flush=True); time.sleep(60)"
    child = start(f'python3 -c "{hold}" & wait')
    wait_until(lambda: pids(said))
    usage = ProcessUsage()
    usage.begin(child.pid)
    assert usage.read(child.pid)[1] < 10  # MB: the shell alone
    assert usage.read(child.pid, descendants=True)[1] > 80


PARENT = """
import sys, time
from pathlib import Path
from zenoh_vision.transport.connection import Connection
from zv.launcher.child import Child
from zv.launcher.command_line import program_command_line
from zv.launcher.group_guard import GroupGuard

def print_line(line):
    print(line, flush=True)

script = "trap '' TERM; sleep 60 & echo pid $!; echo pid $$; wait; sleep 60"
line = program_command_line("mine_front", ["/bin/sh", "-c", script], {}, Path("/"), Connection())
child = Child("mine_front", line, say=print_line, guard=GroupGuard())
child.start()
time.sleep(60)
"""


def test_when_zv_up_is_killed_a_program_ends_with_its_children():
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    with parent.stdout:
        said = [parent.stdout.readline().rstrip() for _ in range(2)]
        descendants = psutil.Process(parent.pid).children(recursive=True)
        assert set(pids(said)) < {each.pid for each in descendants}
        parent.kill()
        parent.wait()
    wait_until(lambda: not any(alive(each.pid) for each in descendants))  # the guard itself, too
