"""``zv topic pub``: send one message or picture, or one after the other at a rate."""

from __future__ import annotations

import time

from common.connection import Connection
from common.errors import ConfigurationError
from common.publishing import FRAME_DELIVERY, MESSAGE_DELIVERY
from services.tools.output import Output
from services.tools.session import ToolSession, key_expression
from services.tools.survey import survey
from services.tools.topic.composing import Composer, composer_of, needs_size
from services.tools.topic.contents import header_fields, received
from services.tools.topic.options import PubOptions
from services.tools.types import camera_of, topic_of


def run(options: PubOptions, connection: Connection, output: Output) -> None:
    """Check what is to be sent, then send it, each time under a header made at that moment.

    Raises:
        ConfigurationError: The key takes no such data, or the data is not as its type says.
        SourceError: The file cannot be read.
    """
    key = key_expression(options.key)
    if "*" in key:
        raise ConfigurationError(f"{key}: one sends on a key, without * and **")
    composer = composer_of(key, options.data, options.type_)
    with ToolSession(connection) as session:
        if options.size is not None:
            width, height = options.size.split("x")
            composer.size = (int(width), int(height))
        elif needs_size(composer):
            composer.size = _size_of_camera(session, key)
        composer.make(0, time.time_ns())  # what is wrong with it is said before anything is sent
        others = survey(session).nodes_publishing(key)
        if others:
            output.note(f"{', '.join(others)} publishes on {key} too: whoever listens gets both")
        sent = _send(session, key, composer, options)
        output.note(f"sent {sent} on {key}")


def _send(session: ToolSession, key: str, composer: Composer, options: PubOptions) -> int:
    """Send until told to stop, or so often; return how often."""
    topic = topic_of(key)
    frame = topic is not None and topic.delivery == "frame"
    congestion_control, priority = FRAME_DELIVERY if frame else MESSAGE_DELIVERY
    publisher = session.link.declare(
        lambda opened: opened.declare_publisher(
            key, congestion_control=congestion_control, priority=priority
        )
    )
    count = options.count or (1 if options.rate is None else None)
    period_s = 1 / (options.rate or 1.0)
    begun_s, epoch, sent = time.monotonic(), time.time_ns(), 0
    while count is None or sent < count:
        sample = composer.make(sent, epoch)
        publisher.now.put(sample.payload, encoding=sample.encoding, attachment=sample.attachment)
        sent += 1
        due_s = begun_s + sent * period_s
        if sent != count and not session.wait(due_s - time.monotonic()):
            break
    return sent


def _size_of_camera(session: ToolSession, key: str) -> tuple[int, int]:
    """Return the frame size of the newest picture of the key's camera.

    Raises:
        ConfigurationError: It has none.
    """
    camera_key = f"{key.split('/')[0]}/{camera_of(key)}/image/compressed"
    for reply in session.ask(camera_key):
        header = None if reply.ok is None else header_fields(received(reply.ok))
        if header is not None:
            return int(header["width"]), int(header["height"])
    raise ConfigurationError(
        f"no camera answers on {camera_key}, so the frame size is unknown: "
        "say --size WIDTHxHEIGHT, or width and height in the message's header"
    )
