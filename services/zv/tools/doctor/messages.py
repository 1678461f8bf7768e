"""Checks messages of other programs against the schemas that their nodes return."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import zenoh

from zenoh_vision.error_text import joined, printable
from zenoh_vision.errors import PayloadError
from zenoh_vision.message_codec import unpack
from zenoh_vision.stream.buffer import Buffer, queue
from zv.tools.doctor.finding import Finding, or_ok
from zv.tools.shared.message_types import MessageType, foreign_types, own_keys
from zv.tools.shared.received import Received, header_of, received
from zv.tools.shared.session import ToolSession

MAX_KEYS = 100
MAX_SAMPLES = 2000
MAX_BYTES = 16 << 20
"""Most samples of all keys together that are kept for the check, and their bytes."""

MAX_MESSAGE_BYTES = 64 << 10
"""Larger messages are not checked."""

CHECK_S = 2.0
"""Most time for the check of those samples; the rest is not checked."""

REMEDY = (
    "who sends them must keep to the schema that it answers; a changed message needs another "
    "version in its name. Receivers drop them as bad_message"
)


@dataclass(slots=True)
class _Stream:
    """The samples of one type of message on one key."""

    checked: int = 0
    bad: int = 0
    error: str = ""
    senders: Counter[str] = field(default_factory=Counter)


class MessageCheck:
    """Collects messages of types that are not of this project, until ``findings`` checks them.

    It does not subscribe to this project's topics, nor to any pictures, since those may be
    produced only for subscribers.
    """

    def __init__(self, session: ToolSession) -> None:
        self._answers = foreign_types(session)
        self._waiting = Buffer[Received](queue(MAX_SAMPLES, MAX_BYTES), lambda _: None)
        if not self._answers.types:
            return
        for key in own_keys(session)[:MAX_KEYS]:
            session.subscribe(key, self._receive)

    def _receive(self, sample: zenoh.Sample) -> None:
        if len(sample.payload) > MAX_MESSAGE_BYTES:
            return
        taken = received(sample)
        if taken.kind in self._answers.types and not taken.deleted:
            self._waiting.put(taken, size=taken.size)

    def findings(self) -> list[Finding]:
        """Return what is wrong with the schemas, and with the messages that came."""
        problems = [
            Finding("WARN", "messages", text, "see the class of this message where it is sent")
            for text in self._answers.problems.values()
        ]
        streams = self._streams()
        problems += _problems(streams)
        if not self._answers.types:
            return problems
        count = sum(stream.checked for stream in streams.values())
        names = joined(sorted(self._answers.types))
        return or_ok(problems, "messages", f"{count} messages are as their schemas say: {names}")

    def _streams(self) -> dict[tuple[str, str], _Stream]:
        found: dict[tuple[str, str], _Stream] = {}
        end_s = time.monotonic() + CHECK_S
        while time.monotonic() < end_s and (taken := self._waiting.take(0)) is not None:
            stream = found.setdefault((taken.key, taken.kind), _Stream())
            stream.checked += 1
            error = error_in(taken.payload or b"", self._answers.types[taken.kind])
            if error:
                header = header_of(taken.attachment)
                sender = "" if header is None else header.node
                stream.bad += 1
                stream.error = stream.error or error
                if sender in stream.senders or len(stream.senders) < MAX_KEYS:
                    stream.senders[sender] += 1
        return found


def error_in(payload: bytes, expected: MessageType) -> str:
    """Return what is wrong with a message; empty if it is as its schema says."""
    try:
        fields = unpack(payload)
        if not isinstance(fields, dict):
            return f"{type(fields).__name__} instead of a map"
        expected.checked(fields)
    except PayloadError as error:
        return printable(error.detail)
    return ""


def _problems(streams: dict[tuple[str, str], _Stream]) -> Iterator[Finding]:
    for (key, name), stream in sorted(streams.items()):
        if stream.bad:
            nodes = [node for node, _ in stream.senders.most_common() if node]
            by = f" (sent by {joined(nodes)})" if nodes else ""
            said = f"{stream.bad} of {stream.checked} messages on {key} are no {name}{by}"
            yield Finding("WARN", "messages", f"{said}: {stream.error}", REMEDY, tuple(nodes))
