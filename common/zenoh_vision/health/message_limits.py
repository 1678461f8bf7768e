"""Limits of a node's messages about itself, which anyone can send; no real node exceeds them."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from zenoh_vision.error_text import shortened
from zenoh_vision.errors import PayloadError
from zenoh_vision.messages import Diagnostics, NodeDescription, Parameter

MAX_COUNTERS = 100
MAX_PARAMETERS = 200
MAX_NAME = 512
MAX_REPORT = 16_000
MAX_PARAMETER = 8_000
MAX_DESCRIPTION = 64_000
"""Limits of the characters in all texts of one message; each text counts ``TEXT`` more."""

MAX_ALL_PARAMETERS = 64_000
"""Limit of characters in all parameters of a node, so that 1000 nodes take 64 MB, not 1.6 GB."""

TEXT = 64


def check_report(name: str, report: Diagnostics) -> None:
    """Raise ``PayloadError`` for another node's diagnostics, and for those that are too large."""
    _check_node(name, report.node)
    if len(report.counters) > MAX_COUNTERS:
        raise PayloadError("too_many", f"{len(report.counters)} counters of {shortened(name)}")
    _check_size("report", name, MAX_REPORT, (report.message, *report.counters))


def check_description(name: str, description: NodeDescription) -> None:
    """Raise ``PayloadError`` for another node's description, and for one that is too large."""
    _check_node(name, description.node)
    about = description
    texts = (about.service, about.version, about.host, about.pipeline or "")
    listed = (*about.cameras, *about.publishes, *about.subscribes)
    _check_size("description", name, MAX_DESCRIPTION, (*texts, *listed))


def check_parameter(name: str, parameter: Parameter) -> None:
    """Raise ``PayloadError`` for another node's parameter, and for one that is too large."""
    _check_node(name, parameter.node)
    _check_size("parameter", name, MAX_PARAMETER, _texts(parameter))


def check_parameters(name: str, parameters: Collection[Parameter]) -> None:
    """Raise ``PayloadError`` if a node has too many parameters, or too large ones in all."""
    if len(parameters) > MAX_PARAMETERS:
        raise PayloadError("too_many", f"more than {MAX_PARAMETERS} parameters of {name!r}")
    if sum(_size(_texts(each)) for each in parameters) > MAX_ALL_PARAMETERS:
        raise PayloadError("too_large", f"all parameters of {shortened(name)} together")


def bounded_parameters(parameters: Iterable[Parameter]) -> dict[str, Parameter]:
    """Return the first of these parameters, by name, that are within all limits together."""
    found: dict[str, Parameter] = {}
    left = MAX_ALL_PARAMETERS
    for each in parameters:
        size = _size(_texts(each))
        if size <= min(MAX_PARAMETER, left) and len(found) < MAX_PARAMETERS:
            left -= size
            found[each.name] = each
    return found


def _texts(one: Parameter) -> tuple[str, ...]:
    texts = (one.name, one.type, one.unit, one.description, one.value, one.default)
    return *(each for each in texts if isinstance(each, str)), *(one.choices or ())


def _size(texts: Iterable[str]) -> int:
    # Python takes up to four bytes for each character of a text that has one outside ASCII.
    return sum(TEXT + len(text) * (1 if text.isascii() else 4) for text in texts)


def _check_node(name: str, said: str) -> None:
    if name != said:
        here, there = shortened(said), shortened(name)
        raise PayloadError("wrong_node", f"a message of {here} on the key of {there}")


def _check_size(what: str, name: str, most: int, texts: Iterable[str]) -> None:
    if _size(texts) > most:
        raise PayloadError("too_large", f"the {what} of {shortened(name)}")
