"""``zv topic pub``: send one message or picture, or several at a rate."""

from __future__ import annotations

import time

import zenoh

from zenoh_vision.errors import ConfigurationError, ExpectationNotMet
from zenoh_vision.keys import camera_of
from zenoh_vision.messages import known_message
from zenoh_vision.topics import COMPRESSED, topic_of
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.declarations import ROUTERS
from zenoh_vision.transport.publisher import FRAME_DELIVERY, MESSAGE_DELIVERY
from zv.tools.shared.discovery import discover
from zv.tools.shared.message_types import (
    MessageType,
    foreign_types,
    known_type,
    type_named,
    type_on,
)
from zv.tools.shared.output import Output
from zv.tools.shared.received import header_of, received
from zv.tools.shared.session import ToolSession, key_expression
from zv.tools.topic.options import PubOptions
from zv.tools.topic.payloads import Payload, payload_for

MATCH_S = 1.0
"""How long to wait for a subscriber before sending without one."""

WAIT_POLL_S = 0.2
FLUSH_S = 10.0
"""How long the last sample may take to reach the router."""


def run(options: PubOptions, connection: Connection, output: Output) -> None:
    """Check the data, wait for a subscriber, then send.

    Raises:
        ConfigurationError: The key does not accept such data, or it does not match the type.
        SourceError: The file cannot be read.
        ExpectationNotMet: The credentials do not allow it.
    """
    key = key_expression(options.key)
    if "*" in key:
        raise ConfigurationError(f"{key}: a key without * and ** is needed")
    known = None if options.type_ is None else known_message(options.type_)
    payload = None
    if known is not None or (options.type_ is None and topic_of(key) is not None):
        # Errors in it need no router.
        payload = payload_for(key, options.data, None if known is None else known_type(known))
    with ToolSession(connection) as session:
        session.require("publish", key)
        if payload is None:
            payload = payload_for(key, options.data, _type(session, key, options.type_))
        if options.size is not None:
            width, height = options.size.split("x")
            payload.size = (int(width), int(height))
        elif payload.needs_size:
            payload.size = _frame_size(session, key, payload.camera)
        sent = _send(session, key, payload, options, output)
        output.note(f"sent {sent} on {key}")


def _type(session: ToolSession, key: str, name: str | None) -> MessageType | None:
    """Return the type of a message that is not of this project."""
    if name is None:
        return type_on(session, key)
    return type_named(name, lambda: foreign_types(session))


def _send(
    session: ToolSession, key: str, payload: Payload, options: PubOptions, output: Output
) -> int:
    """Send the requested number of samples, or until told to stop; return the number sent.

    With BLOCK_FIRST, Zenoh passes a sample that does not fit into the link's queue to another
    thread, and closing the session loses it: a picture of a megabyte never arrived. So the last
    sample is sent with BLOCK, and the router's reply to a query afterwards proves that it has
    received everything.
    """
    topic = topic_of(key)
    frame = topic is not None and topic.delivery == "frame"
    control, priority = FRAME_DELIVERY if frame else MESSAGE_DELIVERY
    publisher = session.link.declare(lambda opened: opened.declare_publisher(key))

    def matched() -> bool:
        return bool(publisher.current.matching_status.matching)  # type: ignore[attr-defined]

    epoch = time.time_ns()
    payload.sample(0, epoch)  # report errors in it first
    if others := discover(session).nodes_publishing(key):
        output.note(f"{', '.join(others)} also publishes on {key}: subscribers get both")
    wanted = options.wait_for or (1 if options.once else None)
    if wanted is not None:
        _wait_for(session, key, wanted, output)
    elif session.wait(MATCH_S, until=matched) and not matched():
        output.note(f"no subscriber on {key} within {MATCH_S:g} s: sending anyway")
    if session.stopping:
        return 0
    count = options.count or (1 if options.rate is None else None)
    period_s = 1 / (options.rate or 1.0)
    begun_s, sent = time.monotonic(), 0
    while sent != count and session.wait(begun_s + sent * period_s - time.monotonic()):
        sample = payload.sample(sent, epoch)
        sent += 1
        session.link.session.put(
            key,
            sample.payload,
            encoding=sample.encoding,
            attachment=sample.attachment,
            congestion_control=zenoh.CongestionControl.BLOCK if sent == count else control,
            priority=priority,
        )
    if sent == count:
        session.ask(ROUTERS, timeout_s=FLUSH_S)
    return sent


def _wait_for(session: ToolSession, key: str, wanted: int, output: Output) -> None:
    """Wait until a number of other sessions subscribe to a key, or until told to stop.

    Raises:
        ExpectationNotMet: The router does not tell who subscribes.
    """
    told: int | None = None
    while not session.stopping:
        count = discover(session).subscriber_count(key)
        if session.stopping or (count is not None and count >= wanted):
            return
        if count is None:
            raise ExpectationNotMet(
                f"the router does not tell who subscribes to {key}: its admin space is off"
            )
        if count != told:
            whom = "a subscriber" if wanted == 1 else f"{wanted} subscribers"
            there = "" if wanted == 1 else f"; there are {count}"
            output.note(f"waiting for {whom} on {key}{there}")
            told = count
        session.wait(WAIT_POLL_S)


def _frame_size(session: ToolSession, key: str, camera: str | None) -> tuple[int, int]:
    """Return the frame size of the newest picture of a message's camera."""
    namespace = key.split("/")[0] if camera_of(key) else session.namespace
    camera_key = COMPRESSED.key(namespace, camera or "")
    for reply in session.ask(camera_key):
        header = None if reply.ok is None else header_of(received(reply.ok).attachment)
        if header is not None:
            return header.width, header.height
    raise ConfigurationError(
        f"no camera answers on {camera_key}, so the frame size is unknown: "
        "give --size WIDTHxHEIGHT, or width and height in the message's header"
    )
