"""Prints samples: as text, one field, JSON, or comma-separated values."""

from __future__ import annotations

from typing import Any

from common.errors import ConfigurationError
from common.messages import Header
from services.tools.output import Output
from services.tools.topic.arrivals import identity_of
from services.tools.topic.contents import Received, fields_of
from services.tools.topic.options import EchoOptions
from services.tools.topic.rendering import NoSuchField, csv_line, flat, lines_of, pick, text_of
from services.tools.types import MESSAGES, schema_of, short_name


class Printer:
    """Prints samples in the form that was asked for.

    Args:
        options: Of the command.
        output: Where to.
    """

    def __init__(self, options: EchoOptions, output: Output) -> None:
        self._options = options
        self._output = output
        self._columns: list[str] | None = None
        self._many = "*" in options.key
        self.left_out = 0

    def show(self, sample: Received) -> bool:
        """Print a sample, and tell whether it was printed.

        Raises:
            ConfigurationError: It has no field of that name.
        """
        options = self._options
        wants_header = options.header or (options.field or "").startswith("header")
        fields = fields_of(sample, header=wants_header)
        if options.field is not None:
            self._show_field(sample, fields, options.field)
        elif self._output.as_json:
            self._output.record(self._about(sample) | {"message": fields})
        elif options.csv:
            return self._show_csv(sample, fields)
        else:
            kind = schema_of(sample.encoding) or sample.encoding
            self._output.line(f"--- {sample.key}  {kind}{_age(sample)}")
            header = {"header": fields.pop("header")} if "header" in fields else {}
            for line in lines_of(header | fields):
                self._output.line(line)
        return True

    def _about(self, sample: Received) -> dict[str, Any]:
        return {
            "key": sample.key,
            "encoding": sample.encoding,
            "received_ns": sample.received_ns,
        }

    def _show_field(self, sample: Received, fields: dict[str, Any], name: str) -> None:
        value = _field(sample, fields, name)
        if self._output.as_json:
            self._output.record(self._about(sample) | {"field": name, "value": value})
            return
        if self._options.csv:
            if self._columns is None:
                self._columns = [*(["key"] if self._many else []), "received_ns", name]
                self._output.line(csv_line(self._columns))
            before = [sample.key] if self._many else []
            self._output.line(csv_line([*before, sample.received_ns, value]))
            return
        before_it = f"{sample.key} " if self._many else ""
        self._output.line(before_it + text_of(value))

    def _show_csv(self, sample: Received, fields: dict[str, Any]) -> bool:
        found = {"key": sample.key, "received_ns": sample.received_ns, **flat(fields)}
        if self._columns is None:
            known = _known_columns(sample, header=self._options.header)
            self._columns = list(dict.fromkeys(["key", "received_ns", *known, *found]))
            self._output.line(csv_line(self._columns))
        if not set(found) <= set(self._columns):
            if not self.left_out:
                kind = schema_of(sample.encoding) or sample.encoding
                self._output.note(
                    f"left out {sample.key} ({kind}), which has other columns; "
                    "name a narrower key or a --field"
                )
            self.left_out += 1
            return False
        self._output.line(csv_line([found.get(column) for column in self._columns]))
        return True


def _age(sample: Received) -> str:
    """Return how long after its capture it came, in words; nothing if that is unknown."""
    identity = identity_of(sample.attachment)
    if identity is None:
        return ""
    return f"  {(sample.received_ns - identity.stamp_ns) / 1e6:.1f} ms after capture"


def _field(sample: Received, fields: dict[str, Any], name: str) -> Any:
    """Return a field; its name may begin with that of the message: ``centroid.x``.

    Raises:
        ConfigurationError: There is none of that name; says which there are.
    """
    kind = short_name(schema_of(sample.encoding)) or "message"
    first, *rest = name.split(".")
    own_names = {kind.lower(), sample.key.rpartition("/")[2]}
    try:
        if first not in fields and first.lower() in own_names and rest:
            return pick(fields, rest)
        return pick(fields, name.split("."))
    except NoSuchField as error:
        raise ConfigurationError(
            f"--field {name}: {sample.key} ({kind}) has no such field; "
            f"at that place there are: {', '.join(error.known)}"
        ) from None


def _known_columns(sample: Received, *, header: bool) -> list[str]:
    """Return the columns of a known message, so that a field that is nil now has one too."""
    message = MESSAGES.get(schema_of(sample.encoding))
    if message is None:
        return []
    columns: list[str] = []
    for name in message.model_fields:
        if name != "header":
            columns.append(name)
        elif header:
            columns += [f"header.{each}" for each in Header.model_fields]
    return columns
