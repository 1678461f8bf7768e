"""``zv topic echo --image``: draws the pictures of a stream in the terminal."""

from __future__ import annotations

import shutil
import sys
import time
from typing import Final

from zenoh_vision.errors import ConfigurationError, ExpectationNotMet
from zenoh_vision.image.frame import Frame
from zenoh_vision.keys import JPEG
from zenoh_vision.stream.buffer import latest
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.frame_intake import FrameIntake
from zenoh_vision.stream.intake import Consumer
from zenoh_vision.topics import topic_of
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.subscriber import subscribe
from zv.tools.shared.discovery import discover, waiting_for
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession, key_expression
from zv.tools.topic.options import EchoOptions
from zv.tools.topic.terminal_picture import Form, drawn, supported_form

POLL_S: Final = 0.1
SILENT_S: Final = 2.0
FASTEST_S: Final = 0.1
"""Least time between two pictures: over ssh, a terminal is a slow link."""

CLEAR: Final = "\x1b[2J\x1b[H"
HOME: Final = "\x1b[H"


def run(options: EchoOptions, connection: Connection, output: Output) -> None:
    """Draw the newest picture again and again, or the first ones of a number.

    Raises:
        ConfigurationError: The key is no single stream of pictures.
        ExpectationNotMet: Fewer pictures than requested arrived in the given time, or none.
    """
    key = key_expression(options.key)
    topic = topic_of(key)
    if "*" in key or (topic is not None and topic.message is not None):
        raise ConfigurationError(f"--image draws one stream of pictures, not {key}")
    form: Form = supported_form() if options.image_form == "auto" else options.image_form
    wanted = 1 if options.once else options.count
    stays = wanted is None and sys.stdout.isatty()  # drawn in place
    shown = 0
    with ToolSession(connection) as session:
        intake = FrameIntake(
            key,
            Consumer(FrameCounters(), lambda _: None),
            latest,
            encoding=JPEG if topic is None else topic.encoding,
        )
        subscribe(session.link, intake)
        begun_s = time.monotonic()
        is_told = False
        while not session.stopping and shown != wanted:
            now_s = time.monotonic()
            if options.for_ is not None and now_s - begun_s > options.for_:
                break
            frame = intake.take(POLL_S, "bgr", None)
            if frame is not None:
                _show(frame, form, place=(HOME if shown else CLEAR) if stays else "")
                shown += 1
                session.wait(FASTEST_S)
            elif not shown and not is_told and now_s - begun_s > SILENT_S:
                is_told = True
                output.note(waiting_for(discover(session).nothing_on(key, pictures=True)))
        if session.stopping:
            return
        if not shown:
            raise ExpectationNotMet(discover(session).nothing_on(key, pictures=True))
        if wanted is not None and shown < wanted:
            raise ExpectationNotMet(f"{shown} of {wanted} pictures arrived on {key}")


def _show(frame: Frame, form: Form, place: str) -> None:
    columns, rows = shutil.get_terminal_size()
    header = frame.header
    age_ms = (time.time_ns() - header.age_start_ns) / 1e6
    about = f"{header.camera} {header.width}x{header.height} seq {header.seq}, {age_ms:.0f} ms old"
    picture = drawn(frame.bgr, form, columns, max(1, rows - 2))
    print(f"{place}{picture}\n{about}\x1b[K", flush=True)
