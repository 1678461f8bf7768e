"""docs/recording.md is true: its commands run as written, one after the other."""

from __future__ import annotations

import signal
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as RosWriter
from rosbags.typesys import Stores, get_typestore

from tests.support.pictures.encoded import STILL, write_video
from tests.support.processes import STOP_S
from tests.support.systems import service, system
from tests.support.viewer.pages import Page, begins, run_as_written
from tests.support.waiting import wait_until
from zv.bag.recording import Recording

PAGE = Page("docs/recording.md")


def prepare(folder: Path) -> None:
    """Make what the page imports and repairs, of what was recorded by the page."""
    write_video(folder / "walk.avi", frames=5, rate_hz=10)
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    name = "sensor_msgs/msg/CompressedImage"
    head = types["std_msgs/msg/Header"](1, types["builtin_interfaces/msg/Time"](5, 6), "cam")
    with RosWriter(folder / "drive.bag") as writer:
        connection = writer.add_connection("/cam/image_raw/compressed", name, typestore=store)
        image = types[name](head, "jpeg", np.frombuffer(STILL, np.uint8))
        writer.write(connection, 10**18, store.serialize_ros1(image, name))
    whole = (folder / "run.mcap").read_bytes()
    (folder / "crash.mcap.partial").write_bytes(whole[: len(whole) * 3 // 4])
    with Recording(folder / "run.mcap") as recording:
        place = recording.chunks[1].offset + 100
    (folder / "damaged.mcap").write_bytes(whole[:place] + b"\xee" * 50 + whole[place + 50 :])


@pytest.mark.timeout(300)
def test_the_commands_run_as_written_one_after_the_other(tmp_path: Path) -> None:
    place = tmp_path / "system"
    place.mkdir()
    with system(place, "tracker") as endpoint:
        for command in PAGE.commands():
            if begins(command, "zv", "recorder"):
                words = command.split()[1:]
                output = ("--output", str(tmp_path / "box.mcap"), "--connect", endpoint)
                box = service(words[0], place, *words[1:], *output, "--after", "1s")
                wait_until(lambda box=box: "keeps the last seconds" in box.complaints)
                continue
            if begins(command, "zv", "bag", "repair") and not (tmp_path / "drive.bag").exists():
                prepare(tmp_path)
            done = run_as_written(command, tmp_path, ZV_CONNECT=endpoint)
            assert done.returncode == 0, (command, done.stdout, done.stderr)
            if begins(command, "zv", "bag", "info"):
                assert done.stdout.splitlines()[0].startswith("run.mcap: ")
            if begins(command, "zv", "bag", "trigger"):
                wait_until(lambda: list(tmp_path.glob("box-*-jam.mcap")))
                box.process.send_signal(signal.SIGINT)
                assert box.process.wait(STOP_S) == 0
    for name in ("run", "front", "part", "both", "ros", "crash", "readable", "walk", "drive"):
        with Recording(tmp_path / f"{name}.mcap") as recording:
            assert recording.is_closed, name
            assert not recording.problems, name
    assert (tmp_path / "frames" / "frames.csv").exists()
    assert (tmp_path / "run.mp4").stat().st_size > 1000
