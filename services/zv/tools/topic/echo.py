"""``zv topic echo``: print messages as they arrive, as text, one field, JSON or CSV."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Self

import zenoh

from zenoh_vision.error_text import suggestion
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet
from zenoh_vision.keys import schema_name_of, type_of
from zenoh_vision.messages import MESSAGES
from zenoh_vision.stream.buffer import Buffer, queue
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.query import POLL_S
from zv.tools.shared.discovery import discover, waiting_for
from zv.tools.shared.message_fields import (
    NoSuchField,
    csv_line,
    fields_of,
    flat,
    lines_of,
    pick,
    text_of,
)
from zv.tools.shared.message_types import MessageType, foreign_types, known_type
from zv.tools.shared.output import Output
from zv.tools.shared.received import Received, header_of, received
from zv.tools.shared.session import ToolSession, key_expression
from zv.tools.topic.options import EchoOptions

MAX_WAITING = 1000
MAX_WAITING_BYTES = 16 << 20
MAX_TYPES = 10
"""Most types of messages on one key that are looked up, since each may take a query."""
QUERY_AFTER_S = 1.0
"""After this long without a message the newest one is queried, as it may be sent only once."""


def run(options: EchoOptions, connection: Connection, output: Output) -> None:
    """Print messages until told to stop, or up to the given number or time.

    Raises:
        ConfigurationError: The type of the messages has no such field.
        ExpectationNotMet: Fewer messages than requested arrived in the given time, or none, or
            none of them has a wanted field.
    """
    if options.image:
        if options.csv or output.as_json or options.field:
            raise ConfigurationError(
                "--image prints no fields: give it without --csv, --json, --field"
            )
        from zv.tools.topic import echo_image  # loads OpenCV, which messages do not need

        echo_image.run(options, connection, output)
        return
    if options.csv and output.as_json:
        raise ConfigurationError("--csv and --json are two formats: give one of them")
    pattern = key_expression(options.key)
    wanted = 1 if options.once else options.count
    printed = 0
    with (
        ToolSession(connection) as session,
        _Printer(options, output, lambda: foreign_types(session).types) as printer,
    ):
        for sample in _samples(session, pattern, options.for_, output):
            printed += printer.print(sample)
            if printed == wanted or session.stopping:
                return
        if session.stopping:
            return
        if not printed and printer.without_field:
            raise ExpectationNotMet(f"none of {printer.without_field} messages was printed")
        if not printed:
            raise ExpectationNotMet(discover(session).nothing_on(pattern))
        if wanted is not None:
            raise ExpectationNotMet(
                f"{printed} of {wanted} messages arrived on {pattern} in {options.for_:g} s"
            )


def _samples(
    session: ToolSession, pattern: str, for_s: float | None, output: Output
) -> Iterator[Received]:
    """Yield samples as they arrive, for a time or until told to stop.

    If none arrives at first, yield the newest by query; if there is none, note which keys exist.
    """
    displaced: deque[Received] = deque(maxlen=1)
    waiting = Buffer[Received](queue(MAX_WAITING, MAX_WAITING_BYTES), displaced.append)

    def receive(sample: zenoh.Sample) -> None:
        taken = received(sample)
        size = len(taken.payload or b"") + len(taken.attachment or b"")
        waiting.put(taken, size=size)

    session.subscribe(pattern, receive)
    begun_s = time.monotonic()
    quiet = True
    while not session.stopping and (for_s is None or time.monotonic() < begun_s + for_s):
        sample = waiting.take(POLL_S)
        if sample is not None:
            quiet = False
            yield sample
        elif displaced:
            displaced.clear()
            output.note("messages arrive faster than they can be printed: some were skipped")
        elif quiet and time.monotonic() > begun_s + QUERY_AFTER_S:
            quiet = False
            newest = [received(reply.ok) for reply in session.ask(pattern) if reply.ok]
            if not waiting.filled:
                yield from newest
                if not newest and for_s is None:
                    output.note(waiting_for(discover(session).nothing_on(pattern)))


class _Printer:
    """Prints samples in the requested format; at its end, notes how many it had to skip.

    Attributes:
        without_field: How many samples lacked a wanted field.
        printed: How many had all wanted fields.
    """

    def __init__(
        self,
        options: EchoOptions,
        output: Output,
        foreign: Callable[[], Mapping[str, MessageType]],
    ) -> None:
        self._options = options
        self._output = output
        self._foreign = foreign
        self._columns: list[str] = []
        self._many_keys = "*" in options.key
        self._said_left_out = False
        self._missed: dict[str, None] = {}
        self._types: dict[str, MessageType | None] = {}
        self.without_field = 0
        self.printed = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Note the number of samples without a wanted field."""
        if self.without_field:
            count = self.without_field
            messages = f"{count} message{'s' if count > 1 else ''}"
            self._output.note(f"skipped {messages} without {' or '.join(self._missed)}")

    def print(self, sample: Received) -> bool:
        """Print a sample, and tell whether it was printed.

        Raises:
            ConfigurationError: A single key was given, and its type has no field of that name.
        """
        options = self._options
        wants_header = options.header or any(each.startswith("header") for each in options.field)
        fields = fields_of(sample, header=wants_header)
        about = {"key": sample.key, "encoding": sample.encoding, "received_ns": sample.received_ns}
        if options.field:
            return self._print_fields(sample, fields, about)
        if options.csv:
            row = {"key": sample.key, "received_ns": sample.received_ns, **flat(fields)}
            known = [] if self._columns else self._known_columns(sample)
            return self._print_row(sample, row, known)
        header = {"header": fields["header"]} if "header" in fields else {}
        title = f"--- {sample.key}  {sample.kind}{_age(sample)}"
        self._output.result(about | {"message": fields}, title, *lines_of(header | fields))
        return True

    def _print_fields(
        self, sample: Received, fields: dict[str, Any], about: dict[str, Any]
    ) -> bool:
        """Print the wanted fields of a sample; count it if it lacks one.

        Raises:
            ConfigurationError: Messages of its type can never have such a field.
        """
        names = self._options.field
        values: dict[str, Any] = {}
        missing: dict[str, tuple[str, ...]] = {}  # with the fields that there are
        for name in names:
            try:
                values[name] = _field(sample, fields, name)
            except NoSuchField as error:
                missing[name] = error.args
        if missing:
            if not self._many_keys and not self.printed:
                found = self._type_of(sample)
                declared = None if found is None else found.fields
                _check_fields(sample, fields, [*missing], declared, always=self._options.once)
            if not self.without_field:
                available = next(iter(missing.values()))
                self._output.note(
                    f"skipping messages without {' or '.join(missing)}: {sample.key} "
                    f"({sample.kind}) has {', '.join(available)}"
                )
            self._missed |= dict.fromkeys(missing)
            self.without_field += 1
            return False
        self.printed += 1
        keys = {"key": sample.key} if self._many_keys else {}
        if self._options.csv:
            return self._print_row(
                sample, keys | {"received_ns": sample.received_ns, **flat(values)}
            )
        if len(names) == 1:
            (value,) = values.values()
            text = " ".join([*keys.values(), text_of(value)])
            self._output.result(about | {"field": names[0], "value": value}, text)
            return True
        shown = (f"{name}={text_of(value)}" for name, value in values.items())
        self._output.result(about | {"fields": values}, " ".join([*keys.values(), *shown]))
        return True

    def _type_of(self, sample: Received) -> MessageType | None:
        """Return the type of a message, by the schema of a node if it is not of this project."""
        name = schema_name_of(sample.encoding)
        if name not in self._types and len(self._types) < MAX_TYPES:
            message = MESSAGES.get(name)
            if message is not None:
                self._types[name] = known_type(message)
            else:
                self._types[name] = self._foreign().get(name) if name else None
        return self._types.get(name)

    def _known_columns(self, sample: Received) -> list[str]:
        """Return the columns of a message's type, so that a field that is nil now has one too."""
        found = self._type_of(sample)
        columns = [] if found is None else found.columns(header=self._options.header)
        return ["key", "received_ns", *columns]

    def _print_row(self, sample: Received, row: dict[str, Any], known: Sequence[str] = ()) -> bool:
        """Print a row of CSV if it fits the titles, which come from the first row and ``known``."""
        if not self._columns:
            # A map that is nil now has the columns of its fields instead.
            maps = {name for name in row if any(each.startswith(f"{name}.") for each in known)}
            self._columns = list(
                dict.fromkeys([*known, *(each for each in row if each not in maps)])
            )
            self._output.line(csv_line(self._columns))
        if {name for name, value in row.items() if value is not None} <= set(self._columns):
            self._output.line(csv_line([row.get(column) for column in self._columns]))
            return True
        if not self._said_left_out:
            self._said_left_out = True
            self._output.note(
                f"skipped {sample.key} ({sample.kind}), which has other columns; "
                "give a narrower key or a --field"
            )
        return False


def _age(sample: Received) -> str:
    """Return the time from capture to arrival of a sample as text; empty if unknown."""
    header = header_of(sample.attachment)
    if header is None:
        return ""
    begun = "capture" if header.replayed_ns is None else "replay"
    return f"  {(sample.received_ns - header.age_start_ns) / 1e6:.1f} ms after {begun}"


def _field(sample: Received, fields: dict[str, Any], name: str) -> Any:
    """Return a field; its name may begin with that of the message: ``centroid.x``.

    Raises:
        NoSuchField: The arguments are the fields that there are.
    """
    path = name.split(".")
    if path[0] not in fields and path[0].lower() in _own_names(sample) and len(path) > 1:
        del path[0]
    return pick(fields, path)


def _own_names(sample: Received) -> tuple[str, str]:
    """Return the names of a message that may precede the name of a field: ``centroid.x``."""
    return type_of(sample.encoding).lower(), sample.key.rpartition("/")[2]


def _check_fields(
    sample: Received,
    fields: dict[str, Any],
    missing: Sequence[str],
    declared: Sequence[str] | None,
    *,
    always: bool,
) -> None:
    """Refuse fields that a known type never has: they are misspelled, and would never come.

    Args:
        sample: The first message.
        fields: Those that it has.
        missing: Those that are wanted and that it lacks.
        declared: The fields of its type; None if the type is unknown.
        always: Refuse missing fields of an unknown type too, since no other message is awaited.

    Raises:
        ConfigurationError: With the fields that there are.
    """
    if declared is None and not sample.is_picture and not always:
        return
    known = {*(declared or ()), *fields, "header"}
    for name in missing:
        path = name.split(".")
        if always or not known & {*path[:1], *(path[1:2] if path[0] in _own_names(sample) else [])}:
            near = suggestion(name, known, before="; ")
            raise ConfigurationError(
                f"--field {name}: {sample.key} ({sample.kind}) has no such field{near}; "
                f"available there: {', '.join(fields)}"
            )
