"""`zv up` as a user types it: real processes, real signals, nothing left behind."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
import zenoh

from tests.integration.conftest import QUICK_ZV
from tests.support import processes
from tests.support.listening import Listener, living_nodes, open_client
from tests.support.processes import ROOT, START_S, STOP_S, Program, environment
from tests.support.routing import free_endpoint
from tests.support.terminal import Terminal
from tests.support.waiting import POLL_S, wait_until
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.session import open_session

NODES = {"router", "camera_front", "tracker_front", "edge_front", "viewer"}


def some_of(folder: Path, *services: str) -> str:
    """Write a launch file of some services, where a test needs no more; return its path."""
    file = folder / "some.toml"
    slow = {"camera": "settings = { rate = 10 }\n"}
    tables = (f'[[node]]\nservice = "{each}"\n{slow.get(each, "")}' for each in services)
    file.write_text("".join(tables))
    return str(file)


def up(folder: Path, *arguments: str) -> Program:
    return Program(["up", "--plain", *arguments], folder, "up", forked=QUICK_ZV)


def up_anew(folder: Path, *arguments: str) -> Program:
    """Start it as a user does: its interpreter begins and ends in the time that is measured."""
    return Program(["-m", QUICK_ZV, "up", "--plain", *arguments], folder, "up")


def open_when_ready(endpoint: str) -> zenoh.Session:
    return open_session(Connection(connect=endpoint, timeout_s=20))


def children(program: Program) -> list[psutil.Process]:
    return psutil.Process(program.process.pid).children()


def running(processes: list[psutil.Process]) -> list[psutil.Process]:
    return list(filter(runs, processes))


def runs(process: psutil.Process) -> bool:
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:  # it ended between the two
        return False


def service_of(process: psutil.Process) -> str:
    return (process.cmdline()[4:] or [""])[0]


def wait_for_children(program: Program, *services: str) -> None:
    """Wait until these are its children: one that has just begun still looks like its parent."""
    wait_until(
        lambda: sorted(map(service_of, children(program))) == sorted(services),
        explain=lambda: str([child.cmdline() for child in children(program)]),
    )


@pytest.mark.quiet
def test_three_services_work_together_and_ctrl_c_ends_all_with_0_within_2_s(tmp_path):
    endpoint = free_endpoint()
    with up_anew(tmp_path, "--listen", endpoint) as program:
        client = open_when_ready(endpoint)
        with client:
            Listener(client, "vision/front/centroid").wait_for(5)
            Listener(client, "vision/front/edges/compressed").wait_for(5)
        for node in NODES:
            program.lines(rf"{node} +running .*")
        started = children(program)
        assert sorted(map(service_of, started)) == ["camera", "edge", "router", "tracker", "view"]
        begun_s = time.monotonic()
        program.process.send_signal(signal.SIGINT)
        assert program.process.wait(5) == 0
        assert time.monotonic() - begun_s < 2.0
        assert not running(started)
    assert f"router: {endpoint}" in program.output
    assert "vision/front/centroid" in program.output
    assert f"zv topic echo vision/front/centroid --connect {endpoint}" in program.output
    greeting = program.output.partition("for example: ")[2].splitlines()
    assert re.fullmatch(r"viewer: http://127\.0\.0\.1:\d+/", greeting[1])
    assert "Traceback" not in program.complaints


def test_what_is_stuck_is_said_what_is_killed_started_again_and_nothing_is_left_behind(tmp_path):
    endpoint = free_endpoint()
    with (
        up(tmp_path, some_of(tmp_path, "camera", "tracker"), "--listen", endpoint) as program,
        open_when_ready(endpoint) as client,
    ):
        centroids = Listener(client, "vision/front/centroid")
        centroids.wait_for(5)
        started = {service_of(p): p for p in children(program)}
        program.lines(r"tracker_front +running +rate.*")
        started["tracker"].suspend()
        program.lines(r"tracker_front +silent for \d+ s .*")
        for service, node in (("tracker", "tracker_front"), ("router", "router")):
            started[service].kill()
            said = f"{node} died (signal 9), starting again in 1 s"
            wait_until(lambda said=said: said in program.complaints)
            centroids.wait_for(5, after_s=time.monotonic())
        again = children(program)
        assert started["camera"] in again
        program.process.kill()
        program.process.wait(STOP_S)
        wait_until(lambda: not running(again))


@pytest.mark.parametrize("by", ["a router", "another program"])
def test_a_taken_port_is_explained_and_nothing_is_started(tmp_path, router, by):
    with socket.create_server(("127.0.0.1", 0)) as server:
        other = f"tcp/127.0.0.1:{server.getsockname()[1]}"
        endpoint = router.endpoint if by == "a router" else other
        with up_anew(tmp_path, "--listen", endpoint) as program:
            assert program.process.wait(START_S) == 2
    assert "the port is in use" in program.complaints
    assert f"--connect {endpoint}" in program.complaints
    assert len(program.complaints.splitlines()) == 1
    assert program.output == ""
    with open_client(router.endpoint) as client:
        assert not living_nodes(client)


def test_a_router_that_cannot_listen_after_all_ends_everything_with_2(tmp_path):
    # The port is tried beforehand, which does not work for every transport.
    launch = tmp_path / "sock.toml"
    launch.write_text(
        f'[router]\nlisten = "unixsock-stream/{tmp_path}/no/such/folder"\n'
        '[[node]]\nservice = "tracker"\n'
    )
    with up(tmp_path, str(launch)) as program:
        started: list[psutil.Process] = []
        while program.process.poll() is None:
            with suppress(psutil.NoSuchProcess):  # it has just ended
                started += [child for child in children(program) if child not in started]
            time.sleep(POLL_S)
        assert program.process.poll() == 2
        assert started
        assert not running(started)
    assert "router ended with status 2" in program.complaints
    assert "is not possible" in program.complaints


@pytest.mark.parametrize("where", ["flags", "environment", "launch file"])
def test_the_router_that_is_there_and_the_namespace_are_used_as_told(
    tmp_path, router, monkeypatch, where
):
    file, flags = Path(some_of(tmp_path, "camera")), []
    if where == "flags":
        flags = ["--connect", router.endpoint, "--namespace", "mine"]
    elif where == "environment":
        changed = {**environment(), "ZV_CONNECT": router.endpoint, "ZV_NAMESPACE": "mine"}
        monkeypatch.setattr(processes, "environment", lambda: changed)
    else:
        own = f'namespace = "mine"\n[router]\nconnect = "{router.endpoint}"\n'
        file.write_text(own + file.read_text())
    with up(tmp_path, str(file), *flags) as program, open_client(router.endpoint) as client:
        Listener(client, "mine/front/image/compressed").wait_for(1)
        wait_for_children(program, "camera")
        assert "already running" in program.output
        assert f"the nodes use that at {router.endpoint}, which" in program.complaints
        program.process.send_signal(signal.SIGTERM)
        assert program.process.wait(STOP_S) == 0


@pytest.mark.quiet
def test_nodes_that_hang_are_killed_after_the_grace_time(tmp_path):
    endpoint = free_endpoint()
    flags = ["--listen", endpoint, "--grace", "1s"]
    with up_anew(tmp_path, some_of(tmp_path, "camera", "tracker"), *flags) as program:
        with open_when_ready(endpoint) as client:
            Listener(client, "vision/front/centroid").wait_for(5)
        started = children(program)
        hanging = [p for p in started if service_of(p) in ("tracker", "router")]
        for process in hanging:
            process.suspend()
        begun_s = time.monotonic()
        program.process.send_signal(signal.SIGINT)
        assert program.process.wait(5) == 0
        assert time.monotonic() - begun_s < 2.0
        assert not running(started)
    assert "tracker_front did not end in time: killed" in program.complaints


def test_a_node_has_the_niceness_of_its_table_and_no_other_has_it(tmp_path):
    file = Path(some_of(tmp_path, "camera", "edge"))
    file.write_text(f"{file.read_text()}nice = 19\n")  # in the last table
    own = os.getpriority(os.PRIO_PROCESS, 0)
    if own == 19:
        pytest.skip("these tests have the highest niceness already")
    with up(tmp_path, str(file), "--listen", free_endpoint()) as program:
        wait_for_children(program, "camera", "edge", "router")
        nodes = {service_of(p): p for p in children(program)}
        wait_until(lambda: nodes["edge"].nice() == 19)
        assert nodes["camera"].nice() == nodes["router"].nice() == own


def test_it_ends_with_all_its_processes_when_nobody_reads_its_lines(tmp_path, router):
    command = [sys.executable, "-m", QUICK_ZV, "up", programs(tmp_path, "a | sleep 600"), "--plain"]
    process = subprocess.Popen(
        [*command, "--connect", router.endpoint],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=ROOT,
        env=environment(),
    )
    assert process.stdout is not None
    assert process.stdout.readline().startswith(b"router: ")
    started = wait_until(lambda: psutil.Process(process.pid).children(recursive=True))
    process.stdout.close()
    _, complaints = process.communicate(timeout=START_S)
    assert process.returncode == 0
    assert b"Traceback" not in complaints
    assert b"Exception" not in complaints
    assert not running(started)


def test_it_starts_again_what_died_and_ends_while_its_output_is_not_read(tmp_path, router):
    """As in a pager, and on a terminal after Ctrl-S."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writing, bytes(1000))
    os.set_blocking(writing, True)
    file = some_of(tmp_path, "camera")
    command = [sys.executable, "-m", QUICK_ZV, "up", "--plain", file]
    with (
        subprocess.Popen(
            [*command, "--connect", router.endpoint],
            stdout=writing,
            stderr=writing,
            cwd=ROOT,
            env=environment(),
        ) as process,
        open_client(router.endpoint) as client,
    ):
        os.close(writing)
        try:
            images = Listener(client, "vision/front/image/compressed")
            images.wait_for(3, START_S)
            (camera,) = psutil.Process(process.pid).children()
            camera.kill()
            before = images.messages[0].header["epoch"]
            wait_until(lambda: images.messages[-1].header["epoch"] != before)
            process.send_signal(signal.SIGINT)
            assert process.wait(STOP_S) == 0
        finally:
            process.kill()
    os.close(reading)


def test_on_a_terminal_a_table_is_drawn_and_lines_go_above_it(tmp_path):
    file = some_of(tmp_path, "camera", "tracker")
    terminal = Terminal(["up", file, "--listen", free_endpoint()], columns=80)
    shown = terminal.until(lambda text: re.search(r"tracker_front +running +\d", text))
    assert "Ctrl-C ends it" in shown
    (tracker,) = (p for p in psutil.Process(terminal.pid).children() if service_of(p) == "tracker")
    tracker.kill()
    terminal.until(lambda text: "tracker_front died (signal 9), starting again in 1 s" in text)
    terminal.until(lambda text: re.search(r"tracker_front +restarting in", text))
    # Only what the new process says is shown of it: held for a moment, it has said nothing.
    again = wait_until(lambda: started_again(terminal.pid, tracker.pid))
    again.suspend()
    terminal.until(lambda text: re.search(r"restarting in(?s:.*)tracker_front +starting", text))
    again.resume()
    running = r"restarting in(?s:.*)tracker_front +starting(?s:.*)tracker_front +running"
    terminal.until(lambda text: re.search(running, text))
    terminal.press_ctrl_c()
    assert terminal.end() == 0
    assert "\x1b[32m" in terminal.raw  # green: it runs
    assert "Traceback" not in terminal.text


def started_again(parent: int, before: int) -> psutil.Process | None:
    """Return the tracker that was started after another one."""
    children = psutil.Process(parent).children()
    return next((p for p in children if p.pid != before and service_of(p) == "tracker"), None)


@pytest.mark.parametrize(
    ("variables", "sign"),
    [({"TERM": "dumb"}, r"a +running, no node"), ({"NO_COLOR": "1"}, "Ctrl-C ends it")],
    ids=["no cursor", "no colours"],
)
def test_a_terminal_that_can_do_less_is_asked_for_less(tmp_path, router, variables, sign):
    command = ["up", programs(tmp_path, "a | sleep 600"), "--connect", router.endpoint]
    terminal = Terminal(command, variables=variables, program=QUICK_ZV)
    terminal.until(lambda text: re.search(sign, text))
    terminal.press_ctrl_c()
    assert terminal.end() == 0
    assert "\x1b[32m" not in terminal.raw
    assert variables.get("TERM") != "dumb" or "\x1b[" not in terminal.raw


def test_a_file_that_was_played_is_not_played_again(tmp_path, router):
    folder = tmp_path / "pictures"
    folder.mkdir()
    import cv2
    import numpy as np

    for number in range(3):
        cv2.imwrite(str(folder / f"{number}.png"), np.full((48, 64, 3), 40 * number, np.uint8))
    launch = tmp_path / "played.toml"
    launch.write_text(
        f'[[node]]\nservice = "camera"\nsettings = {{ source = "{folder}" }}\n'
        '[[node]]\nservice = "idle"\ncommand = "sleep 600"\n'
    )
    with up(tmp_path, str(launch), "--connect", router.endpoint) as program:
        wait_until(lambda: "camera_front has finished" in program.complaints)
        program.lines(r"camera_front +finished.*")
        program.lines(r"idle +running, no node.*")
        assert "camera" not in map(service_of, running(children(program)))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--connect", "tcp/127.0.0.1:1", "--listen", "tcp/127.0.0.1:2"], "give one"),
        (["--listen", "7447"], "--listen = '7447' is not allowed"),
    ],
    ids=["two routers", "no endpoint"],
)
def test_wrong_use_ends_with_2_before_anything_is_started(tmp_path, arguments, said):
    """Wrong files: tests/zv/launcher/test_launch_file.py, test_launch_file_programs.py."""
    with up(tmp_path, *arguments) as program:
        assert program.process.wait(START_S) == 2
    assert program.output == ""
    (line,) = program.complaints.splitlines()
    assert said in line


def test_programs_of_ones_own_have_rows_and_a_remap_reaches_them_too(tmp_path):
    launch = tmp_path / "own.toml"
    launch.write_text(
        '[[node]]\nservice = "camera"\n'
        '[[node]]\nservice = "mean"\ncamera = "front"\ncommand = "python mean.py"\n'
        '[[node]]\nservice = "idle"\ncommand = "sleep 600"\n'
    )
    (tmp_path / "mean.py").write_text(
        "import os, sys\n"
        "from zenoh_vision import Connection, Node\n"
        "camera = sys.argv[1].removeprefix('--camera=')\n"
        "connection = Connection(os.environ['ZV_CONNECT'], os.environ['ZV_NAMESPACE'])\n"
        "keys = ['edges/compressed', 'centroid']\n"
        "with Node('mean', camera=camera, connection=connection, publishes=keys) as node:\n"
        "    for frame in node.frames('image/compressed', want='gray'):\n"
        "        print(frame.header.camera, flush=True) if frame.header.seq % 9 == 0 else None\n"
    )
    flags = ["--listen", free_endpoint(), "--remap", "front=left", "--namespace", "robot1"]
    with up(tmp_path, str(launch), *flags) as program:
        program.lines(r"mean_left +running +rate [1-9]\d.*dropped.*")
        program.lines(r"idle +running, no node.*")
        program.lines(r"mean_left publishes robot1/left/edges/compressed, robot1/left/centroid")
        assert "idle runs, but no node of this name has announced itself" in program.complaints
        wait_until(lambda: "mean_left: left" in program.complaints)
        started = psutil.Process(program.process.pid).children(recursive=True)
        program.process.send_signal(signal.SIGINT)
        assert program.process.wait(STOP_S) == 0
        assert not running(started)


def programs(folder: Path, text: str) -> str:
    """Write a launch file of the user's own programs; ``NAME | SCRIPT | MORE KEY`` on a line."""
    file = folder / "programs.toml"
    tables = []
    for line in text.strip().splitlines():
        name, script, *keys = line.strip().split(" | ")
        words = f'service = "{name}"\ncommand = ["sh", "-c", "{script}"]\n'
        tables.append("[[node]]\n" + words + "".join(f"{key}\n" for key in keys))
    file.write_text("".join(tables))
    return str(file)


@pytest.mark.parametrize(
    ("nodes", "status"),
    [
        ("a | exit 0\nb | exit 0", 0),
        # The first of the file that failed.
        ("a | exit 0\nb | exit 9 | restart = false\nc | exit 3 | restart = false", 9),
        ("a | kill -9 $$ | restart = false", 137),
        ("a | exit 2", 2),  # wrong use is not tried again
        ("a | sleep 60\nb | exit 5 | required = true", 5),
        ("a | exit 7 | restart = false\nb | sleep 1 | required = true", 0),
    ],
)
def test_it_ends_when_its_nodes_have_ended_with_what_happened_to_them(
    tmp_path, router, nodes, status
):
    flags = ["--connect", router.endpoint]
    with up(tmp_path, programs(tmp_path, nodes), *flags) as program:
        assert program.process.wait(START_S) == status
    reason = "is required, so everything ends" if "required" in nodes else "all nodes have ended"
    assert reason in program.complaints


def test_it_ends_when_its_nodes_have_ended_while_it_waits_for_a_router(tmp_path):
    file = programs(tmp_path, "a | exit 3 | restart = false")
    with up(tmp_path, file, "--connect", free_endpoint()) as program:
        assert program.process.wait(START_S) == 3


SLOW = "trap 'sleep 1.6; echo flushed; exit 0' TERM; echo ready; while true; do sleep 0.05; done"


@pytest.mark.quiet
@pytest.mark.parametrize(
    ("grace", "saved"),
    [("", True), ("grace = 0.5\n", False), ("grace = '500ms'\n", False)],
    ids=["default", "number", "text"],
)
def test_a_program_has_time_to_write_what_it_holds(tmp_path, router, grace, saved):
    file = Path(programs(tmp_path, f"a | {SLOW}"))
    file.write_text(grace + file.read_text())
    with up(tmp_path, str(file), "--connect", router.endpoint) as program:
        wait_until(lambda: "a: ready" in program.complaints)
        program.process.send_signal(signal.SIGTERM)
        assert program.process.wait(10) == 0
    assert ("a: flushed" in program.complaints) == saved
    assert ("did not end in time: killed" in program.complaints) != saved


def test_a_second_ctrl_c_kills_at_once(tmp_path, router):
    file = programs(tmp_path, "a | trap '' TERM; echo ready; while true; do sleep 0.05; done")
    flags = ["--connect", router.endpoint, "--grace", "1h"]
    with up(tmp_path, file, *flags) as program:
        wait_until(lambda: "a: ready" in program.complaints)
        started = children(program)
        program.process.send_signal(signal.SIGINT)
        wait_until(lambda: program.process.send_signal(signal.SIGINT) or not running(started))
        assert program.process.wait(STOP_S) == 0
        assert not running(started)


def test_no_password_of_a_source_is_in_a_log_or_a_list_of_processes(tmp_path, router):
    word = "hunter2"
    # Other forms: tests/zv/launcher/test_launch_file.py, tests/zenoh_vision/test_error_text.py.
    urls = [f"rtsp://me:{word}@127.0.0.1:9/a", f"http://127.0.0.1:9/mjpg?user=a&pwd={word}"]
    launch = tmp_path / "up.toml"
    launch.write_text(
        "".join(
            f'[[node]]\nservice = "camera"\ncamera = "c{n}"\nsettings = {{ source = "{url}" }}\n'
            for n, url in enumerate(urls)
        )
    )
    with up(tmp_path, str(launch), "--connect", router.endpoint) as program:
        wait_for_children(program, *["camera"] * len(urls))
        lines = [" ".join(process.cmdline()) for process in children(program)]
        assert all(line.count("camera") for line in lines)
        # The nodes wait for their sources.
        wait_until(lambda: program.complaints.count("again in 0.5 s") >= len(urls))
        lines += [" ".join(process.cmdline()) for process in children(program)]
    assert word not in "".join(lines)
    assert word not in program.complaints + program.output
