"""Every example runs as its docstring says, against real processes."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import jsonschema
import numpy as np
import pytest

from tests.support import systems
from tests.support.fork_server import SCRIPT
from tests.support.listening import Listener, newest, open_client
from tests.support.processes import HEIGHT, ROOT, START_S, WIDTH, Program, catches, run_program
from tests.support.routing import free_endpoint
from tests.support.systems import running_router, service
from tests.support.typist import type_zv
from tests.support.waiting import wait_until
from zenoh_vision.messages import Centroid

EXAMPLES = ROOT / "examples"


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A router, the synthetic camera and a tracker; the endpoint, once centroids flow."""
    with systems.system(tmp_path_factory.mktemp("system"), "tracker") as endpoint:
        yield endpoint


@pytest.fixture
def tracker_alone(tmp_path: Path) -> Iterator[str]:
    """A router and a tracker that waits for a camera; the endpoint."""
    with running_router(tmp_path) as endpoint, service("tracker", tmp_path, "--connect", endpoint):
        yield endpoint


def run_once(name: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    return type_zv([EXAMPLES / name, *arguments], program=SCRIPT)


def centroids(endpoint: str, count: int) -> list[Centroid]:
    """Return the next centroids that the tracker publishes."""
    with open_client(endpoint) as session:
        found = Listener(session, "vision/front/centroid").wait_for(count, START_S)
        return [Centroid.from_bytes(message.payload) for message in found[:count]]


def test_subscribe_ends_silently_when_nobody_reads_its_output_any_more(system: str):
    line = f"{sys.executable} {EXAMPLES / 'subscribe.py'} {system} | head -1; echo $PIPESTATUS"
    done = run_program(["bash", "-c", line])
    assert re.fullmatch(r"front .*\n0\n", done.stdout)
    assert done.stderr == ""


ENDPOINTS = ("tcp/127.0.0.1:1", "tcp/nonsense", "foo")


@pytest.mark.parametrize(
    ("name", "arguments", "endpoints"),
    [
        ("subscribe.py", [], ENDPOINTS),
        ("save_frame.py", ["frame.jpg"], ENDPOINTS),
        ("publish_from_anything.py", [], ENDPOINTS[:2]),  # what does not begin with tcp/ is a file
        ("pick_from_belt.py", ["gate", "600"], ENDPOINTS),
    ],
)
def test_without_a_router_an_example_says_so_in_one_line(
    name: str, arguments: list[str], endpoints: tuple[str, ...]
):
    for endpoint in endpoints:
        done = run_once(name, *arguments, endpoint)
        said = f"no router at {endpoint} (tcp/ADDRESS:PORT); start one: zv router\n"
        assert done.stderr == said
        assert (done.returncode, done.stdout) == (1, "")


NOWHERE = "vision/nowhere/image/compressed"


@pytest.mark.parametrize(
    ("name", "file", "arguments", "says"),
    [
        ("publish_from_anything.py", "none.jpg", [], "{file}: No such file or directory"),
        ("save_frame.py", "none/x.jpg", ["{system}"], "{file}: No such file or directory"),
        ("save_frame.py", "x.jpg", ["{system}", NOWHERE], f"nobody answered on {NOWHERE}"),
    ],
)
def test_what_an_example_cannot_do_is_one_line(
    system: str, tmp_path: Path, name: str, file: str, arguments: list[str], says: str
):
    done = run_once(name, tmp_path / file, *(each.format(system=system) for each in arguments))
    assert (done.returncode, done.stderr) == (1, says.format(file=tmp_path / file) + "\n")


def test_own_service_publishes_its_message_and_answers_its_schema(system: str, tmp_path: Path):
    with (
        Program(
            [EXAMPLES / "own_service.py", "--connect", system], tmp_path, "own", SCRIPT
        ) as program,
        open_client(system) as session,
    ):
        sample = newest(session, "vision/front/brightness")
        assert sample.encoding == "application/msgpack;my.Brightness.v1"
        message = sample.body
        assert 0 < message["mean"] < 255
        assert message["header"]["node"] == "brightness_front"
        assert sample.header == message["header"]
        for name in ("Brightness", "my.Brightness.v1"):
            schema = newest(session, f"@vision/schema/{name}")
            jsonschema.validate(message, json.loads(schema.payload))
        assert program.interrupt() == 0
        assert not program.output


def test_own_service_ends_with_ctrl_c_while_it_waits_for_a_router(tmp_path: Path):
    with Program(
        [EXAMPLES / "own_service.py", "--connect", free_endpoint()], tmp_path, "own"
    ) as program:
        wait_until(lambda: catches_sigterm(program), START_S, lambda: program.complaints)
        assert program.interrupt() == 0
        assert not program.complaints


def test_own_service_takes_the_endpoint_from_the_environment_and_says_what_it_waits_for(
    tmp_path: Path,
):
    with running_router(tmp_path) as endpoint:
        own = EXAMPLES / "own_service.py"
        with Program([own], tmp_path, "own", SCRIPT, ZV_CONNECT=endpoint) as program:
            keys = "vision/front/image/compressed or vision/front/image"
            said = f"brightness_front: waiting: no frame on {keys} for 2 s"
            wait_until(lambda: said in program.complaints, START_S, lambda: program.complaints)
            assert program.interrupt() == 0


def catches_sigterm(program: Program) -> bool:
    """Tell whether the node has put its own handlers in place."""
    assert program.process.poll() is None, program.complaints
    loaded = "zenoh" in Path(f"/proc/{program.process.pid}/maps").read_text()
    return loaded and catches(program.process.pid, signal.SIGTERM)


def test_show_shows_each_picture_until_q(system: str):
    windows = ROOT / "tests" / "support" / "programs" / "fake_windows.py"
    words = [windows, EXAMPLES / "show.py", system, "tracked/compressed"]
    done = type_zv(words, program=SCRIPT)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [f"tracked/compressed {HEIGHT} {WIDTH} 3 uint8"] * 5


def test_show_says_at_once_what_to_install_instead_of_an_opencv_without_windows():
    done = run_once("show.py", free_endpoint())
    assert done.returncode == 1
    assert done.stderr == (
        "this OpenCV has no windows: pip uninstall --yes opencv-python-headless, "
        "then pip install opencv-python\n"
    )
    said = (EXAMPLES / "show.py").read_text()
    for command in ("pip uninstall --yes opencv-python-headless", "pip install opencv-python"):
        assert f"\n{command}\n" in said  # and nowhere that both are to be installed


@pytest.mark.parametrize("files", [False, True], ids=["drawn", "from files"])
def test_a_bare_publisher_is_tracked_under_an_identity_made_up(
    tracker_alone: str, tmp_path: Path, files: bool
):
    arguments: list[str | Path] = [EXAMPLES / "publish_from_anything.py", tracker_alone]
    if files:
        for number in range(3):
            picture = np.full((120, 160, 3), 80 * number, np.uint8)
            cv2.imwrite(str(tmp_path / f"{number}.jpg"), picture)
            arguments.append(tmp_path / f"{number}.jpg")
    with Program(arguments, tmp_path, "publish", SCRIPT) as program:
        first, *_, last = centroids(tracker_alone, 5)
        assert program.interrupt() == 0
        assert not program.complaints
    assert first.header.assumed is True
    assert last.header.epoch == first.header.epoch
    assert last.header.seq > first.header.seq
    assert (last.header.width, last.header.height) == ((160, 120) if files else (320, 240))


def test_a_publisher_with_three_more_lines_gives_its_own_identity(
    tracker_alone: str, tmp_path: Path
):
    arguments = [EXAMPLES / "publish_from_anything.py", tracker_alone, "--header"]
    with Program(arguments, tmp_path, "publish", SCRIPT) as program:
        found = centroids(tracker_alone, 40)  # the background is learned for a second
        assert program.interrupt() == 0
    assert {centroid.header.assumed for centroid in found} == {None}
    assert len({centroid.header.epoch for centroid in found}) == 1
    assert any(centroid.x is not None for centroid in found)  # the square moves


def test_every_example_is_tested():
    places = (
        "docs/test_examples.py",
        "docs/test_replay_doc.py",
        "integration/tracker/test_world.py",
    )
    text = "".join((ROOT / "tests" / place).read_text() for place in places)
    assert all(f'"{path.name}"' in text for path in EXAMPLES.glob("*.py"))


def test_every_program_that_opens_zenoh_reconnects_within_a_fifth_of_a_second():
    """Zenoh's default makes a client wait for seconds after its router is back."""
    pages = [*(ROOT / "docs").glob("*.md"), ROOT / "README.md", *EXAMPLES.glob("*.py")]
    opening = [page for page in pages if re.search(r"zenoh(\.|::)open\(", page.read_text())]
    assert len(opening) >= 6
    for page in opening:
        text = page.read_text()
        assert "period_max_ms" in text, page.name
        assert len(re.findall("connect/retry|RETRY}", text)) == len(
            re.findall(r"zenoh(?:\.|::)open\(", text)
        ), page.name
