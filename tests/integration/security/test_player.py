"""``zv bag play`` where rights are required: with a certificate for it, and without."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.support.fork_server import ZV
from tests.support.listening import Listener
from tests.support.processes import Program
from tests.support.recordings import centroids, frames, write
from tests.support.secured import Secured, official, secured
from tests.support.typist import type_zv
from tests.support.waiting import wait_until

FRAMES = frames(30)


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Secured]:
    made = secured(tmp_path_factory.mktemp("player"))
    made.add(player=("walk", "door"))
    write(made.folder / "run.mcap", FRAMES, centroids(FRAMES))
    with official(made, made.folder):
        yield made


def words(system: Secured, who: str, *flags: str) -> list[str | Path]:
    given = ["bag", "play", system.folder / "run.mcap", *flags, "--connect", system.endpoint]
    return [*given, "--credentials", system.file(who)]


def test_a_player_sends_a_recording_as_its_camera_and_is_controlled(
    system: Secured, tmp_path: Path
):
    with system.client("guest") as guest:
        received = Listener(guest, "vision/walk/**")
        given = words(system, "player", "--as", "walk", "--loop")
        with Program(given, tmp_path, "play", forked=ZV) as program:
            received.wait_for(60)
            found = {message.key for message in received.messages}
            assert found >= {"vision/walk/image/compressed", "vision/walk/centroid"}
            # A node looks every 3 s what is denied to it.
            health = Listener(guest, "@vision/diagnostics/player_walk")
            reports = [report.body["message"] for report in health.wait_for(6)]
            assert not any("denies" in said for said in (*reports, program.complaints))
            control = ["param", "set", "player_walk", "paused=true", "--connect", system.endpoint]
            done = type_zv([*control, "--credentials", system.file("operator")])
            assert done.returncode == 0, done.stderr


CASES = [("player", "front"), ("operator", "walk"), ("camera_front", "walk")]


@pytest.mark.parametrize(("who", "camera"), CASES)
def test_nobody_else_and_as_nothing_else(system: Secured, who: str, camera: str):
    done = type_zv(words(system, who, "--as", camera))
    assert done.returncode == 1, done.stdout
    assert f"zv: {who} may not publish vision/{camera}/" in done.stderr


def test_the_router_decides_whatever_a_file_says(system: Secured, tmp_path: Path):
    with system.witness() as witness, ExitStack() as playing:
        received = [Listener(witness, f"vision/{camera}/**") for camera in ("front", "walk")]
        programs = []
        for who, camera in CASES:
            forged = system.content(who)
            forged["metadata"]["zenoh_vision"]["rights"]["publish"] = ["**"]
            system.file(f"forged_{who}").touch(0o600)
            system.rewrite(f"forged_{who}", forged)
            given = words(system, f"forged_{who}", "--as", camera, "--loop")
            programs.append(playing.enter_context(Program(given, tmp_path, who, forked=ZV)))
        for program in programs:
            wait_until(lambda program=program: "the router denies" in program.complaints, 30)
        playing.close()  # each has sent all that it will
        assert not [listener.messages for listener in received if listener.messages]
