"""Writes a recording in which the results of one node are those of now."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Self

import msgpack

from zenoh_vision import keys
from zenoh_vision.errors import PayloadError
from zenoh_vision.message_codec import Message, unpack
from zenoh_vision.messages import NodeDescription, ParameterList
from zv.bag.record import Record
from zv.bag.recording import Recording
from zv.bag.writer import Writer
from zv.tools.bag.answered import frame_id
from zv.tools.bag.recorded_node import RecordedNode

MARKS = ("replay", "replayed_ns", "lockstep")


class Updated:
    """Copies a recording without a node's results, and puts others behind each frame.

    The file gets its name when all is written; an interrupted one leaves none.

    Attributes:
        answers: Number of results that were written.

    Raises:
        RecordingError: The file exists, or cannot be written.
    """

    def __init__(
        self, path: Path, recording: Recording, is_left_out: Callable[[Record], bool]
    ) -> None:
        self.answers = 0
        self._writer = Writer(path, recording.about)
        self._rest = recording.records()
        self._is_left_out = is_left_out
        self._system: tuple[str, ...] = ()
        self._first_ns = self._last_ns = recording.start_ns

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        """Copy what is left and close the file; remove it after an error."""
        try:
            if kind is None:
                for record in self._rest:
                    self._copy(record)
                self._writer.close()
        finally:
            self._writer.discard()

    def describe(
        self, node: RecordedNode, about: NodeDescription, parameters: ParameterList | None
    ) -> None:
        """Write what the node is now, instead of what was recorded of it."""
        key = keys.node_key(node.namespace, node.name)
        own = keys.parameters_key(node.namespace, node.name)
        self._system = key, own, keys.diagnostics_key(node.namespace, node.name)
        self._message(key, about.model_copy(update={"started_ns": self._first_ns}))
        if parameters is not None:
            self._message(own, parameters)

    def add(self, frame: Record, answers: Iterable[Record]) -> None:
        """Copy all up to a frame, which follows the one before, and write its results."""
        wanted = frame_id(frame)
        for record in self._rest:
            self._copy(record)
            if record.key == frame.key and frame_id(record) == wanted:
                break
        for answer in answers:
            self.answers += 1
            self._writer.add(_of_recording(answer, frame.log_time_ns, self._last_ns))

    def _copy(self, record: Record) -> None:
        described = any(
            record.key == each or record.key.startswith(f"{each}/") for each in self._system
        )
        if not described and not self._is_left_out(record):
            self._last_ns = record.log_time_ns
            self._writer.add(record)

    def _message(self, key: str, message: Message) -> None:
        encoding = keys.msgpack_of(message.schema_name)
        self._writer.add(
            Record(key, message.to_bytes(), encoding, log_time_ns=self._first_ns, origin="query")
        )


def _of_recording(answer: Record, frame_ns: int, log_ns: int) -> Record:
    """Return a result with the times of the recording: it arrived with its frame."""
    header = _timed(answer.header, frame_ns)
    payload = answer.payload
    if "msgpack" in answer.encoding:
        try:
            fields = unpack(payload)
        except PayloadError:
            fields = None
        if isinstance(fields, dict) and isinstance(fields.get("header"), dict):
            payload = msgpack.packb(fields | {"header": _timed(fields["header"], frame_ns)})
    return Record(answer.key, payload, answer.encoding, msgpack.packb(header), log_time_ns=log_ns)


def _timed(header: dict[str, Any], frame_ns: int) -> dict[str, Any]:
    kept = {name: value for name, value in header.items() if name not in MARKS}
    received_ns, done_ns = header.get("received_ns"), header.get("done_ns")
    if isinstance(received_ns, int) and isinstance(done_ns, int):
        kept |= {"received_ns": frame_ns, "done_ns": frame_ns + max(0, done_ns - received_ns)}
    return kept
