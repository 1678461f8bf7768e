"""Limits of a node's messages about itself, which anyone can send; no real node exceeds them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from zenoh_vision.error_text import shortened
from zenoh_vision.errors import PayloadError
from zenoh_vision.messages import Diagnostics, NodeDescription, Parameter

MAX_COUNTERS = 100
MAX_PARAMETERS = 200
MAX_NAME = 512
MAX_REPORT = 16_000
MAX_PARAMETER = 8_000
"""Limits of the characters in all texts of one message; each text counts ``TEXT`` more."""

MAX_SIZES = {
    Diagnostics: (MAX_REPORT, "report"),
    Parameter: (MAX_PARAMETER, "parameter"),
    NodeDescription: (64_000, "description"),
}
MAX_ALL_PARAMETERS = 64_000
"""Limit of characters in all parameters of a node, so that 1000 nodes take 64 MB, not 1.6 GB."""

TEXT = 64


def check(name: str, message: Diagnostics | NodeDescription | Parameter) -> None:
    """Raise ``PayloadError`` for a message of another node, and for one that is too large."""
    if name != message.node:
        here, there = shortened(message.node), shortened(name)
        raise PayloadError("wrong_node", f"a message of {here} on the key of {there}")
    if isinstance(message, Diagnostics) and len(message.counters) > MAX_COUNTERS:
        raise PayloadError("too_many", f"{len(message.counters)} counters of {shortened(name)}")
    most, what = MAX_SIZES[type(message)]
    if _size(tuple(message.__dict__.values())) > most:
        raise PayloadError("too_large", f"the {what} of {shortened(name)}")


def check_parameters(name: str, parameters: Collection[Parameter]) -> None:
    """Raise ``PayloadError`` if a node has too many parameters, or too large ones in all."""
    if len(parameters) > MAX_PARAMETERS:
        raise PayloadError("too_many", f"more than {MAX_PARAMETERS} parameters of {name!r}")
    if sum(_size(tuple(each.__dict__.values())) for each in parameters) > MAX_ALL_PARAMETERS:
        raise PayloadError("too_large", f"all parameters of {shortened(name)} together")


def bounded_parameters(parameters: Iterable[Parameter]) -> dict[str, Parameter]:
    """Return the first of these parameters, by name, that are within all limits together."""
    found: dict[str, Parameter] = {}
    left = MAX_ALL_PARAMETERS
    for each in parameters:
        size = _size(tuple(each.__dict__.values()))
        if size <= min(MAX_PARAMETER, left) and len(found) < MAX_PARAMETERS:
            left -= size
            found[each.name] = each
    return found


def _size(value: object) -> int:
    """Return the characters of all texts in a value, with ``TEXT`` more for each."""
    if isinstance(value, str):
        # Python takes up to four bytes for each character of a text that has one outside ASCII.
        return TEXT + len(value) * (1 if value.isascii() else 4)
    if isinstance(value, Mapping):
        return sum(map(_size, value.values())) + sum(map(_size, value))
    return sum(map(_size, value)) if isinstance(value, list | tuple) else 0
