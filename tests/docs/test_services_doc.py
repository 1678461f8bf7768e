"""docs/services.md is true: the template is shown as it is written, and each program runs."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest
import zenoh

from tests.support.fork_server import SCRIPT, ZV
from tests.support.listening import ask, newest, open_client, wait_for_nodes
from tests.support.processes import ROOT, START_S, Program
from tests.support.routing import free_endpoint
from tests.support.typist import type_zv
from tests.support.viewer.pages import Page, run_as_written
from tests.support.waiting import wait_until
from zenoh_vision import Connection, Node
from zenoh_vision.messages import Centroid
from zenoh_vision.testing import running_router
from zv.tools.new.service import write

PAGE = Page("docs/services.md")
TEMPLATE, *SNIPPETS = PAGE.blocks("python")
WINDOWS = ROOT / "tests" / "support" / "programs" / "fake_windows.py"
PIXELS = np.full((48, 64, 3), 90, np.uint8)


def name_of(code: str) -> str:
    """Return the name of the node that a program opens."""
    found = re.search(r'Node\(\s*"(\w+)"', code)
    assert found is not None
    return found[1]


BY_NAME = {name_of(code): code for code in SNIPPETS}


# The template


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the page's first command writes."""
    place = tmp_path_factory.mktemp("mine")
    assert PAGE.commands()[:2] == ["zv new service brightness", "cd brightness"]
    assert type_zv(["new", "service", "brightness"], folder=place).returncode == 0
    return place / "brightness"


def test_the_page_shows_what_the_template_writes(tmp_path: Path):
    service, launch, _ = write("brightness", tmp_path / "brightness")
    assert service.read_text() == TEMPLATE
    assert [launch.read_text()] == PAGE.blocks("toml")


def test_the_commands_run_as_written_one_after_the_other(folder: Path):
    commands = PAGE.commands()[2:]
    alone = "python brightness.py --config brightness.toml"
    launched = "zv up launch.toml"
    assert {alone, launched} < set(commands)
    endpoint = free_endpoint()
    variables = {"ZV_CONNECT": endpoint}
    up = [*launched.split()[1:-1], folder / "launch.toml", "--listen", endpoint, "--plain"]
    slow = {"ZV_CAMERA_RATE": "10"}
    with Program(up, folder, "up", forked=ZV, **slow), open_client(endpoint) as session:
        wait_for_nodes(session, "brightness_front", deadline_s=START_S)
        newest(session, "vision/front/brightness", START_S)
        for command in commands:
            if command not in (alone, launched):
                done = run_as_written(command, folder, **variables)
                assert done.returncode == 0, (command, done.stdout, done.stderr)
    with running_router() as endpoint, open_client(endpoint) as session:
        words = [folder / "brightness.py", "--config", folder / "brightness.toml"]
        with Program([*words, "--connect", endpoint], folder, "alone", SCRIPT) as program:
            (gain,) = wait_until(lambda: ask(session, "@vision/param/brightness_front/gain"))
            assert gain.body["value"] == 2.0
            assert program.interrupt() == 0


def test_the_flags_and_statuses_that_the_page_names_are_those_of_the_service(folder: Path):
    said = PAGE.text.partition("## What `run_service` gives")[2].partition("\n## ")[0]
    text = type_zv([folder / "brightness.py", "--help"], program=SCRIPT).stdout
    named = re.findall(r"--[a-z][a-z-]+|ZV_[A-Z]+(?:_[A-Z]+)?", said)
    assert named  # else the section has another title
    for word in named:
        assert word in text, word


# The other programs


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """Of a router with three cameras that are triggered together, and a result for each frame."""
    names = ("front", "left", "right")
    topics = ["image/compressed", "centroid"]
    stop = threading.Event()
    with (
        running_router() as endpoint,
        Node("camera", camera=names, connection=Connection(endpoint), publishes=topics) as node,
    ):

        def publish() -> None:
            while not stop.wait(0.05):
                stamp_ns = time.time_ns()
                for name in names:
                    frame = node.publish_picture(
                        "image/compressed", PIXELS, camera=name, stamp_ns=stamp_ns
                    ).frame
                    assert frame is not None
                    centroid = Centroid(header=frame.header, x=5, y=6, box=(1, 2, 8, 8), area=1.0)
                    node.publish("centroid", centroid)

        thread = threading.Thread(target=publish)
        thread.start()
        try:
            yield endpoint
        finally:
            stop.set()
            thread.join()


@contextmanager
def running(name: str, endpoint: str, folder: Path) -> Iterator[Program]:
    """Run the page's program of a name, which shows its windows as text, until Ctrl-C or a q."""
    code, file = BY_NAME[name], folder / f"{name}.py"
    settings = re.findall(r"^class (\w+Settings)", code, re.MULTILINE) or ["ServiceSettings"]
    end = "from zenoh_vision import ServiceSettings, run_service\n\nrun_service(run, {})\n"
    file.write_text(f"{code}\n{end.format(settings[-1])}")
    with Program([WINDOWS, file, "--connect", endpoint], folder, name, SCRIPT) as program:
        yield program
        ended = program.process.wait(START_S) if name == "window" else program.interrupt()
        assert ended == 0
        assert "Traceback" not in program.complaints


@pytest.fixture
def session(endpoint: str) -> Iterator[zenoh.Session]:
    with open_client(endpoint) as session:
        yield session


PRINTED = {
    "changes": [rf"{name} \d+ 0\.0" for name in ("front", "left", "right")],
    "stereo": [r"(\d+) \1 0\.0 ms"],
    "listener": [r"\d+ 5 6"],
    "spot": [r"\d+ 90"],
    "size": [r"vision/front/image/compressed 48 64 3"],
    "window": ["frame 48 64 3 uint8"],
}
"""Lines that a program prints, by its name."""

PUBLISHED = {"blur": "blurred/compressed", "stripes": "image", "light": "light"}


def test_every_program_of_the_page_is_run():
    assert set(BY_NAME) == {*PRINTED, *PUBLISHED}
    assert len(BY_NAME) == len(SNIPPETS)


@pytest.mark.parametrize("name", PRINTED)
def test_a_program_prints_what_it_says(name: str, endpoint: str, tmp_path: Path):
    with running(name, endpoint, tmp_path) as program:
        for pattern in PRINTED[name]:
            program.lines(pattern)


def test_the_blurred_pictures_are_published(endpoint: str, session, tmp_path: Path):
    with running("blur", endpoint, tmp_path):
        picture = newest(session, "vision/front/blurred/compressed")
    assert picture.encoding == "image/jpeg"
    assert picture.header["node"] == "blur_front"


def test_the_camera_of_ones_own_counts_and_has_its_parameter(tmp_path: Path):
    with (
        running_router() as alone,
        open_client(alone) as session,
        running("stripes", alone, tmp_path),
    ):
        image = newest(session, "vision/front/image/compressed")
        pixels = cv2.imdecode(np.frombuffer(image.payload, np.uint8), cv2.IMREAD_UNCHANGED)
        assert pixels.shape == (192, 256)
        report = "@vision/diagnostics/stripes_front"
        unseen = "dropped.no_subscriber"
        wait_until(lambda: newest(session, report).body["counters"].get(unseen, 0) > 2)
        assert newest(session, "@vision/param/stripes_front/quality").body["value"] == 80


def test_the_light_goes_on_and_off(endpoint: str, session, tmp_path: Path):
    seen: set[bool] = set()

    def both() -> bool:
        seen.update(each.body["on"] for each in ask(session, "vision/front/light"))
        return seen == {True, False}

    with running("light", endpoint, tmp_path):
        wait_until(both)
