"""The systems that are compared: how each is started, and what it needs."""

from __future__ import annotations

import importlib.util
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.peers.contest import Failed, Outcome, Programs, measured, programs
from benchmarks.system import free_endpoint
from zenoh_vision.shm.machine import why_impossible
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.session import open_session

PROGRAMS = "benchmarks.peers.programs"
ROS_PYTHON = "/usr/bin/python3"
ROS_PACKAGES = "ros-core python3-rospy python3-cv-bridge python3-sensor-msgs"
START_S = 60.0

Run = Callable[[Path, int, int], Outcome]
"""Runs a system with a video, a JPEG quality and a number of frames."""


@dataclass(frozen=True, slots=True)
class System:
    """One row of the comparison.

    Attributes:
        name: For the table.
        run: Runs and measures it.
        jpeg: Whether the quality of the JPEG matters to it.
        missing: Returns why it cannot run and what to install; empty if it can.
        ours: Whether it is this system.
        result: Whether it measures a tracker's result instead of decoded pixels.
        reads: Whether it only reads the video, so that only its CPU time and memory matter.
    """

    name: str
    run: Run
    jpeg: bool = True
    missing: Callable[[], str] = lambda: ""
    ours: bool = False
    result: bool = False
    reads: bool = False


def _router(started: Programs) -> str:
    endpoint = free_endpoint()
    started.python("zv", "router", "--listen", endpoint, between=True)
    open_session(Connection(connect=endpoint, timeout_s=START_S)).close()
    return endpoint


def _zenoh_vision(transport: str, pipeline: str = "") -> Run:
    """Return what measures the age of frames, or of a tracker's centroids with a pipeline."""

    def run(video: Path, quality: int, frames: int) -> Outcome:
        with programs() as started:
            endpoint = _router(started)
            source = ("--source", f"{video}", "--loop", "--rate", "30")
            connect = ("--connect", endpoint)
            started.python("zv", "camera", *source, "--quality", f"{quality}", *connect)
            if pipeline:
                chosen = ("--pipeline", pipeline, "--transport", transport)
                started.python("zv", "tracker", *chosen, *connect)
            consumer = f"{PROGRAMS}.zenoh_vision_consumer"
            taken = "centroid" if pipeline else transport
            return measured(
                started,
                started.python(consumer, endpoint, f"{frames}", taken, talks=True),
                frames,
            )

    return run


def _bare_zenoh(video: Path, quality: int, frames: int) -> Outcome:
    with programs() as started:
        endpoint, program = _router(started), f"{PROGRAMS}.bare_zenoh"
        started.python(program, "publish", endpoint, f"{video}", f"{quality}")
        consumer = started.python(program, "subscribe", endpoint, f"{frames}", talks=True)
        return measured(started, consumer, frames)


def _imagezmq(video: Path, quality: int, frames: int) -> Outcome:
    with programs() as started:
        port, program = free_endpoint().rpartition(":")[2], f"{PROGRAMS}.image_zmq"
        consumer = started.python(program, "subscribe", port, f"{frames}", talks=True)
        started.python(program, "publish", port, f"{video}", f"{quality}")
        return measured(started, consumer, frames)


def _ros(form: str) -> Run:
    def run(video: Path, quality: int, frames: int) -> Outcome:
        port = int(free_endpoint().rpartition(":")[2])
        kind = "raw" if form == "raw" else f"{quality}"
        program = f"{Path(__file__).parent / 'programs' / 'ros.py'}"
        with tempfile.TemporaryDirectory() as home, programs() as started:
            env = {
                "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
                "ROS_IP": "127.0.0.1",
                "ROS_HOME": home,
                "PYTHONPATH": "",
            }
            started.start("rosmaster", "--core", "-p", f"{port}", env=env, between=True)
            _wait_for(port)
            started.start(ROS_PYTHON, program, "publish", f"{video}", kind, env=env)
            subscribe = (ROS_PYTHON, program, "subscribe", f"{frames}", kind)
            consumer = started.start(*subscribe, env=env, talks=True)
            return measured(started, consumer, frames)

    return run


def _wait_for(port: int) -> None:
    deadline_s = time.monotonic() + START_S
    while time.monotonic() < deadline_s:
        try:
            socket.create_connection(("127.0.0.1", port), 1).close()
        except OSError:
            time.sleep(0.05)
        else:
            return
    raise Failed(f"no ROS master within {START_S:.0f} s")


def _reading(reader: str) -> Run:
    def run(video: Path, _quality: int, frames: int) -> Outcome:
        with programs() as started:
            program = (f"{PROGRAMS}.reading", reader, f"{video}", f"{frames}")
            return measured(started, started.python(*program, talks=True), frames)

    return run


def _one_process(video: Path, _quality: int, frames: int) -> Outcome:
    with programs() as started:
        program = f"{PROGRAMS}.one_process"
        return measured(
            started, started.python(program, f"{video}", f"{frames}", talks=True), frames
        )


def _no_imagezmq() -> str:
    if importlib.util.find_spec("imagezmq") is not None:
        return ""
    return "install it with: .venv/bin/pip install --group peers"


def _no_ros() -> str:
    needed = "import rospy, cv_bridge, sensor_msgs.msg, cv2"
    found = (
        os.access(ROS_PYTHON, os.X_OK)
        and not subprocess.run(
            [ROS_PYTHON, "-c", needed], capture_output=True, env={}, check=False
        ).returncode
        and any(os.access(f"{each}/rosmaster", os.X_OK) for each in os.get_exec_path())
    )
    return "" if found else f"install it on Debian with: apt install {ROS_PACKAGES}"


READING = System("reading the video, OpenCV", _reading("opencv"), jpeg=False, reads=True)
OUR_READING = System("reading the video, PyAV", _reading("libav"), jpeg=False, reads=True)
"""What of the CPU time of the other systems, and of ours, no transport can avoid."""

SHARED_MEMORY = System(
    "zenoh-vision, shared memory",
    _zenoh_vision("shm"),
    jpeg=False,
    missing=why_impossible,
    ours=True,
)
ROS_RAW = System("ROS 1, raw", _ros("raw"), jpeg=False, missing=_no_ros)


def systems() -> list[System]:
    """Return all systems, in the order in which they are run."""
    return [
        READING,
        OUR_READING,
        System("zenoh-vision, JPEG", _zenoh_vision("jpeg"), ours=True),
        SHARED_MEMORY,
        System("imagezmq", _imagezmq, missing=_no_imagezmq),
        System("Zenoh and OpenCV", _bare_zenoh),
        System("ROS 1, compressed", _ros("compressed"), missing=_no_ros),
        ROS_RAW,
        System("tutorial, one process", _one_process, jpeg=False, result=True),
        *_trackers(),
    ]


def _trackers() -> list[System]:
    """Return the tracker with both pipelines, as on the camera's machine and as on another."""
    rows = {
        "tracker": ("shm", "robust"),
        "tutorial's tracker": ("shm", "tutorial"),
        "tutorial's tracker, JPEG": ("jpeg", "tutorial"),
    }
    return [
        System(
            f"zenoh-vision, {name}",
            _zenoh_vision(transport, pipeline),
            jpeg=False,
            missing=why_impossible if transport == "shm" else lambda: "",
            ours=True,
            result=True,
        )
        for name, (transport, pipeline) in rows.items()
    ]
