"""The commands of ``zv param``: list, get, describe, set, dump and load."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import islice
from pathlib import Path

import msgpack

from zenoh_vision import keys
from zenoh_vision.config.constraints import limits, plain, toml_file, toml_line
from zenoh_vision.config.settings import read_toml
from zenoh_vision.error_text import shortened, suggestion
from zenoh_vision.errors import (
    ConfigurationError,
    ExpectationNotMet,
    ParameterRefused,
    PayloadError,
    SourceError,
    VisionError,
)
from zenoh_vision.health.fleet import MAX_NODES
from zenoh_vision.messages import Parameter, ParameterList
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.query import Reply
from zv.tools.param.options import DumpOptions, ListOptions, LoadOptions, NamedOptions, SetOptions
from zv.tools.shared.nodes import missing_node
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession

TRUE = {"true", "yes", "on", "1"}
FALSE = {"false", "no", "off", "0"}


def list_(options: ListOptions, connection: Connection, output: Output) -> None:
    """Print the parameters of a node, or of all nodes."""
    with ToolSession(connection) as session:
        found = _ask(session, output, options.node)
    parameters = [parameter for one in found for parameter in one.parameters]
    rows = [
        [
            one.node,
            one.name,
            None if one.value is None else plain(one.value),
            None if one.default is None else plain(one.default),
            one.unit or "",
            limits(one),
        ]
        for one in parameters
    ]
    columns = ["node", "parameter", "value", "default", "unit", "allowed"]
    output.table(columns, rows, [one.to_map() for one in parameters])


def get(options: NamedOptions, connection: Connection, output: Output) -> None:
    """Print a single value alone, several with their names."""
    for one in _chosen(options, connection, output):
        text = plain(one.value) if len(options.names) == 1 else toml_line(one.name, one.value)
        output.result(one.to_map(), text)


def describe(options: NamedOptions, connection: Connection, output: Output) -> None:
    """Print meaning, type, range, unit and default of parameters."""
    for one in _chosen(options, connection, output):
        output.result(one.to_map(), *described(one))


def set_(options: SetOptions, connection: Connection, output: Output) -> None:
    """Set parameters, all or none."""
    texts = assignments(options.values)
    with ToolSession(connection) as session:
        (before, *_) = _ask(session, output, options.node)
        # An unknown name is sent unchanged: the node's error text is the most precise.
        known = {one.name: one for one in before.parameters}
        values = {
            name: value_of(known[name], text) if name in known else text
            for name, text in texts.items()
        }
        _change(session, before, values, output)


def dump(options: DumpOptions, connection: Connection, output: Output) -> None:
    """Write the parameters of a node as TOML."""
    with ToolSession(connection) as session:
        (found, *_) = _ask(session, output, options.node)
    if output.as_json or options.output == "-":
        values = {one.name: one.value for one in found.parameters}
        output.result(values, *toml_file(found).removesuffix("\n").split("\n"))
        return
    try:
        Path(options.output).write_text(toml_file(found), encoding="utf-8")
    except OSError as error:
        raise SourceError(f"{options.output}: {error.strerror or error}") from None
    output.note(f"{len(found.parameters)} parameters written to {options.output}")


def load(options: LoadOptions, connection: Connection, output: Output) -> None:
    """Send the values of a TOML file to a node, all or none."""
    try:
        Path(options.file).open("rb").close()
    except OSError as error:
        raise SourceError(f"{options.file}: {error.strerror or error}") from None
    values = read_toml(options.file)
    with ToolSession(connection) as session:
        (before, *_) = _ask(session, output, options.node)
        _change(session, before, values, output)


def _chosen(options: NamedOptions, connection: Connection, output: Output) -> list[Parameter]:
    """Return the parameters of a node with the given names, or all.

    Raises:
        ParameterRefused: There is no such parameter; the text has the most similar name.
    """
    with ToolSession(connection) as session:
        (found, *_) = _ask(session, output, options.node)
    known = {parameter.name: parameter for parameter in found.parameters}
    for name in options.names:
        if name not in known:
            hint = suggestion(name, known, before="; ")
            raise ParameterRefused(
                f"{found.node}: there is no parameter {name!r}{hint}", ", ".join(known)
            )
    return [known[name] for name in options.names or known]


def _ask(
    session: ToolSession, output: Output, node: str | None, payload: bytes | None = None
) -> list[ParameterList]:
    """Return the parameters of a node, or of all nodes, as at least one list.

    Anyone can answer for a node. When several do, that is said, and which one answers truly is
    unknown: a refusal counts, and what cannot be read does not while another can.

    Args:
        session: An open session.
        output: Where it is said that several answer.
        node: None for all nodes.
        payload: A change of parameters, which the node makes before it replies.

    Raises:
        ParameterRefused: The node refuses; the text has the reason and what is allowed.
        ExpectationNotMet: It does not run, or does not reply with parameters.
    """
    replies: list[Reply] = []
    if node is None or keys.is_name(node):
        replies = session.ask(keys.parameters_key(session.namespace, node or "*"), payload)
    if not replies:
        raise missing_node(session, node or "*", "parameters")
    found, failed = _read(replies, node)
    answers = Counter(one.node for one in found) if node is None else {node: len(replies)}
    for name, count in islice(answers.items(), MAX_NODES):
        if count > 1:
            output.note(
                f"{count} answer for {name}, and one may speak for another: see zv node list"
            )
    if failed is not None and (not found or isinstance(failed, ParameterRefused)):
        raise failed
    return sorted(found, key=lambda one: one.node)[:MAX_NODES]


def _read(
    replies: Iterable[Reply], node: str | None
) -> tuple[list[ParameterList], VisionError | None]:
    """Return the parameters in replies, and an error among them: a refusal rather than others."""
    found: list[ParameterList] = []
    refusal: VisionError | None = None
    failed: VisionError | None = None
    for reply in replies:
        try:
            one = reply.message(ParameterList)
            if node not in (None, one.node):
                raise PayloadError("wrong_node", f"of {shortened(one.node)}")
            found.append(one)
        except ParameterRefused as refused:
            refusal = ParameterRefused(f"{node}: {refused.error}", refused.allowed)
        except PayloadError as error:
            failed = failed or ExpectationNotMet(f"{node or '*'}: the answer is {error}")
        except ExpectationNotMet as error:
            failed = failed or error
    return found, refusal or failed


def _change(
    session: ToolSession, before: ParameterList, values: Mapping[str, object], output: Output
) -> None:
    """Set parameters and print the values that have changed; with ``--json`` all given ones.

    Raises:
        ConfigurationError: No parameter can have such a value, or the node refuses.
    """
    for name, value in values.items():
        try:
            msgpack.packb(value)
        except (TypeError, ValueError, OverflowError):
            raise ConfigurationError(
                f"{before.node}: {name} = {value} is not allowed; "
                "allowed: a number, a text, true or false"
            ) from None
    (after, *_) = _ask(session, output, before.node, msgpack.packb(dict(values)))
    was: dict[str, bool | int | float | str | None] = {
        one.name: one.value for one in before.parameters
    }
    given = [one for one in after.parameters if one.name in values]
    changed = [one for one in given if one.value != was.get(one.name)]
    for one in given if output.as_json else changed:
        before_it = _shown(was.get(one.name))
        output.result(one.to_map(), f"{one.name}: {before_it} -> {_shown(one.value)}")
    same = len(given) - len(changed)
    rest = f"; {same} value{'s' if same > 1 else ''} unchanged" if same else ""
    output.note(f"{after.node} is at revision {after.revision}{rest}")


# Values and texts


def assignments(texts: Iterable[str]) -> dict[str, str]:
    """Return the names and values in texts such as ``quality=60``.

    Raises:
        ConfigurationError: A text has another form, or a name occurs twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, separator, value = text.partition("=")
        if not separator or not name:
            raise ConfigurationError(f"{text!r} is not NAME=VALUE; allowed: such as quality=60")
        if name in found:
            raise ConfigurationError(f"{name} is given twice; allowed: once")
        found[name] = value
    return found


def value_of(parameter: Parameter, text: str) -> object:
    """Return the value of a text by the parameter's type.

    A text that is not such a value is returned unchanged, so that the node reports the error.
    """
    if not text and parameter.default is None:
        return None
    if parameter.type == "bool" and text.lower() in TRUE | FALSE:
        return text.lower() in TRUE
    try:
        if parameter.type == "int" and re.fullmatch(r"[+-]?[0-9]+", text):
            return int(text)
        return float(text) if parameter.type == "float" else text
    except ValueError:
        return text


def described(parameter: Parameter) -> list[str]:
    """Return a parameter's value, meaning, type, range, unit and default as lines of text."""
    facts = [parameter.type, limits(parameter), parameter.unit or ""]
    return [
        toml_line(parameter.name, parameter.value),
        f"    {parameter.description}",
        f"    {'; '.join(filter(None, facts))}; default {_shown(parameter.default)}",
    ]


def _shown(value: bool | int | float | str | None) -> str:
    return "not set" if value is None else plain(value) or '""'
