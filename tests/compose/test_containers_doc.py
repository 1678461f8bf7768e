"""docs/containers.md is true: its commands run one after the other as they stand there."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support import detector_models
from tests.support.containers.stack import Stack, compose_command, run
from tests.support.containers.witness import Witness
from tests.support.pictures.encoded import write_video
from tests.support.routing import free_port
from tests.support.viewer.pages import Page
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.compose, pytest.mark.timeout(1500)]
WORDS = (
    "docker",
    "cp",
    "curl",
    "ZV_VIDEO=./walk.avi",
    "ZV_TRACKER_MODEL=/models/yolo11n.onnx",
    "ZV_COMPOSE_CONNECT=tcp/192.0.2.1:7447",
)


def written() -> list[str]:
    """Return the commands of the page, in order."""
    lines = Page("docs/containers.md").commands()
    return [line for line in lines if shlex.split(line)[0] in WORDS]


def compose_lines() -> list[str]:
    return [line for line in written() if "docker compose" in line]


def test_there_are_such_commands():
    assert len(compose_lines()) >= 5


@pytest.mark.parametrize("line", compose_lines())
def test_a_compose_command_runs_as_written(line: str, image: str, clone: Path):
    """Run detached, in a project and on a port of the test's own; then look at the streams."""
    words = shlex.split(line, comments=True)
    settings = dict(word.split("=", 1) for word in words if word.startswith("ZV_"))
    words = words[len(settings) + 2 :]
    files = [words[at + 1] for at, word in enumerate(words) if word == "-f"]
    assert all((clone / file).exists() for file in files)
    assert not files or files[0] == "docker-compose.yml"  # whose folder all paths start from
    overrides = [Path(file).stem for file in files[1:]]
    rest = words[2 * len(files) :]
    if "webcam" in overrides or "remote-router" in overrides:
        # No camera and no such router here: what Compose makes of them is in test_settings.py.
        Stack(clone, overrides, {"ZV_COMPOSE_CONNECT": "tcp/192.0.2.1:7447"}).compose(
            "config", "-q"
        )
        return
    if "ZV_VIDEO" in settings:
        write_video(clone / "walk.avi", frames=300, rate_hz=30)
    if "ZV_TRACKER_MODEL" in settings:
        (clone / "models").mkdir()
        (clone / "models").chmod(0o755)
        model = detector_models.save(clone / "models" / "yolo11n.onnx", "yolov8", size=640)
        model.chmod(0o644)
    if rest[0] == "up":
        with Stack(clone, overrides, settings) as stack, Witness(stack.endpoint) as witness:
            witness.flows(10)
        return
    with Stack(clone, overrides, settings) as stack:
        stack.compose(*rest)


def test_curl_saves_a_frame_as_written(image: str, clone: Path, tmp_path: Path):
    lines = [line for line in written() if line.startswith("curl")]
    assert lines
    port = free_port()
    with (
        Stack(clone, ["rest"], {"ZV_REST_PORT": str(port)}) as stack,
        Witness(stack.endpoint) as witness,
    ):
        witness.flows(10)
        for line in lines:
            words = shlex.split(line.replace("127.0.0.1:8000", f"127.0.0.1:{port}"), comments=True)
            file = tmp_path / words[words.index("-o") + 1]

            def saved(words: list[str] = words, file: Path = file) -> bool:
                run(*words, cwd=tmp_path, check=False)
                return file.exists() and file.stat().st_size > 1000

            wait_until(saved, 30)
            pixels = cv2.imdecode(np.frombuffer(file.read_bytes(), np.uint8), cv2.IMREAD_COLOR)
            assert pixels is not None


def test_env_example_can_be_copied_as_it_is(clone: Path, tmp_path: Path, docker):
    assert "cp .env.example .env" in written()
    stack = Stack(clone)
    plain = stack.compose("config")
    (clone / ".env").write_text((clone / ".env.example").read_text())
    try:
        assert stack.compose("config") == plain
        # And what is uncommented acts.
        text = (clone / ".env").read_text().replace("#ZV_CAMERA_RATE=30", "ZV_CAMERA_RATE=7")
        (clone / ".env").write_text(text)
        command = compose_command()
        assert command
        env = {name: value for name, value in os.environ.items() if not name.startswith("ZV_")}
        assert "ZV_CAMERA_RATE: '7'" in run(*command, "config", cwd=clone, env=env).replace(
            '"', "'"
        )
    finally:
        (clone / ".env").unlink()
