"""``zv topic echo``: print messages as they arrive, as text, one field, JSON or CSV."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any

import zenoh

from zenoh_vision.errors import ConfigurationError, ExpectationNotMet
from zenoh_vision.keys import schema_name_of, type_of
from zenoh_vision.messages import MESSAGES, Header
from zenoh_vision.stream.buffer import Buffer, queue
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.query import POLL_S
from zv.tools.shared.discovery import discover
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession, key_expression
from zv.tools.topic.message_fields import (
    NoSuchField,
    Received,
    csv_line,
    fields_of,
    flat,
    header_of,
    lines_of,
    pick,
    received,
    text_of,
)
from zv.tools.topic.options import EchoOptions

MAX_WAITING = 1000
MAX_WAITING_BYTES = 16 << 20
QUERY_AFTER_S = 1.0
"""After this long without a message the newest one is queried, as it may be sent only once."""


def run(options: EchoOptions, connection: Connection, output: Output) -> None:
    """Print messages until told to stop, or up to the given number or time.

    Raises:
        ConfigurationError: There is no such field.
        ExpectationNotMet: Fewer messages than requested arrived in the given time, or none.
    """
    if options.csv and output.as_json:
        raise ConfigurationError("--csv and --json are two formats: give one of them")
    pattern = key_expression(options.key)
    wanted = 1 if options.once else options.count
    printer, printed = _Printer(options, output), 0
    with ToolSession(connection) as session:
        for sample in _samples(session, pattern, options.for_, output):
            printed += printer.print(sample)
            if printed == wanted or session.stopping:
                return
        if session.stopping:
            return
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
                    output.note(f"{discover(session).nothing_on(pattern)}; waiting")


class _Printer:
    """Prints samples in the requested format."""

    def __init__(self, options: EchoOptions, output: Output) -> None:
        self._options = options
        self._output = output
        self._columns: list[str] = []
        self._many_keys = "*" in options.key
        self._said_left_out = False

    def print(self, sample: Received) -> bool:
        """Print a sample, and tell whether it was printed.

        Raises:
            ConfigurationError: It has no field of that name.
        """
        options = self._options
        wants_header = options.header or (options.field or "").startswith("header")
        fields = fields_of(sample, header=wants_header)
        about = {"key": sample.key, "encoding": sample.encoding, "received_ns": sample.received_ns}
        if options.field is not None:
            value = _field(sample, fields, options.field)
            keys = {"key": sample.key} if self._many_keys else {}
            if options.csv:
                return self._print_row(
                    sample, keys | {"received_ns": sample.received_ns, options.field: value}
                )
            text = " ".join([*keys.values(), text_of(value)])
            self._output.result(about | {"field": options.field, "value": value}, text)
        elif options.csv:
            row = {"key": sample.key, "received_ns": sample.received_ns, **flat(fields)}
            known = ["key", "received_ns", *_known_columns(sample, header=options.header)]
            return self._print_row(sample, row, known)
        else:
            header = {"header": fields["header"]} if "header" in fields else {}
            title = f"--- {sample.key}  {sample.kind}{_age(sample)}"
            self._output.result(about | {"message": fields}, title, *lines_of(header | fields))
        return True

    def _print_row(self, sample: Received, row: dict[str, Any], known: Sequence[str] = ()) -> bool:
        """Print a row of CSV if it fits the titles, which come from the first row and ``known``."""
        if not self._columns:
            self._columns = list(dict.fromkeys([*known, *row]))
            self._output.line(csv_line(self._columns))
        if row.keys() <= set(self._columns):
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
    return f"  {(sample.received_ns - header.stamp_ns) / 1e6:.1f} ms after capture"


def _field(sample: Received, fields: dict[str, Any], name: str) -> Any:
    """Return a field; its name may begin with that of the message: ``centroid.x``."""
    path = name.split(".")
    own_names = (type_of(sample.encoding).lower(), sample.key.rpartition("/")[2])
    if path[0] not in fields and path[0].lower() in own_names and len(path) > 1:
        del path[0]
    try:
        return pick(fields, path)
    except NoSuchField as error:
        raise ConfigurationError(
            f"--field {name}: {sample.key} ({sample.kind}) has no such field; "
            f"available there: {', '.join(error.args)}"
        ) from None


def _known_columns(sample: Received, *, header: bool) -> list[str]:
    """Return the columns of a known message, so that a field that is nil now has one too."""
    message = MESSAGES.get(schema_name_of(sample.encoding))
    columns: list[str] = []
    for name in message.model_fields if message else ():
        if name != "header":
            columns.append(name)
        elif header:
            columns += [f"header.{each}" for each in Header.model_fields]
    return columns
