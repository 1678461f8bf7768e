"""Finds the edges of every frame of a video or a recording, without dropping one."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.status import Status

from zenoh_vision import Connection, Frame, Node
from zenoh_vision.errors import ExpectationNotMet, PayloadError, SourceError
from zenoh_vision.image import codecs
from zenoh_vision.image.files import names_image
from zenoh_vision.messages import Contours, Header
from zenoh_vision.topics import CONTOURS
from zenoh_vision.transport.router import private_router
from zv.bag.private_system import Child, zv_command
from zv.edge.detectors.rendering import Gray
from zv.edge.finding import EdgesOfFrame, decode_ahead
from zv.edge.settings import EdgeSettings

CAMERA: Final = "file"
LOOK_S: Final = 0.1
HEAD: Final = 16


def is_of_frames(file: Path) -> bool:
    """Tell whether a file is a video or a recording, and no image.

    Raises:
        SourceError: It cannot be read.
    """
    if file.is_dir() or names_image(file):
        return False
    try:
        with file.open("rb") as opened:
            head = opened.read(HEAD)
    except OSError as error:
        raise SourceError(f"{file}: {error.strerror or error}") from None
    return not head.startswith((codecs.JPEG_START, codecs.PNG_START))


def of_every_frame(
    file: Path,
    settings: EdgeSettings,
    mask: Gray | None,
    write: Callable[[int, EdgesOfFrame], None],
) -> int:
    """Call a function with the edges of each frame; return the number of frames.

    A camera of its own reads the file, and goes on when the edges of a frame are written.

    ``write`` gets the number of each frame, from 0. Without a mask, edges are found everywhere.

    Raises:
        SourceError: The file cannot be read.
        ExpectationNotMet: Told to stop before the end.
    """
    count = 0
    console = Console(stderr=True)
    with private_router() as (_, endpoint), Status("edges", console=console) as shown:
        if not sys.stderr.isatty():
            shown.stop()
        connection = Connection(endpoint)
        answers = [replace(CONTOURS, lazy=False)]
        with Node(
            "edge", camera=CAMERA, connection=connection, publishes=answers, parameters=settings
        ) as node:
            frames = node.frames(
                want=lambda frame: decode_ahead(frame, frame.revision.settings),
                max_pixels=settings.max_pixels,
                max_age_s=None,
            )
            command = zv_command(
                *("camera", "--camera", CAMERA, "--source", str(file), "--lockstep", node.name)
            )
            with Child(command, endpoint, connection.namespace) as camera:
                for frame in node.receive(frames, every_s=LOOK_S):
                    if frame is not None:
                        write(frame.header.seq, _edges(frame, file, settings, mask))
                        node.publish(answers[0], _answer(node.header(frame)))
                        count += 1
                        shown.update(f"{count} frames")
                    elif camera.status is not None:
                        break
                if camera.status is None:
                    raise ExpectationNotMet(f"told to stop after {count} frames")
                camera.check(expected=0)
                camera.pass_on_warnings()  # of what it could not read
    return count


def _edges(frame: Frame, file: Path, settings: EdgeSettings, mask: Gray | None) -> EdgesOfFrame:
    try:
        return EdgesOfFrame(frame, settings, mask)
    except PayloadError as error:
        raise SourceError(f"{file}: frame {frame.header.seq}: {error}") from None


def _answer(header: Header) -> Contours:
    """Return a message that only says that a frame is done."""
    return Contours(header=header, density=0.0, contours=(), omitted=0, segments=())
