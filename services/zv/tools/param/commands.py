"""The commands of ``zv param``: list, get, describe, set, dump and load."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from fnmatch import fnmatchcase
from itertools import islice

import msgpack

from zenoh_vision import keys
from zenoh_vision.config.constraints import limits, plain, toml_file, toml_line
from zenoh_vision.config.parameter_groups import flattened
from zenoh_vision.config.settings import read_toml
from zenoh_vision.error_text import shortened, suggestion
from zenoh_vision.errors import (
    ConfigurationError,
    ExpectationNotMet,
    ParameterRefused,
    PayloadError,
    VisionError,
)
from zenoh_vision.health.fleet import MAX_NODES
from zenoh_vision.host.files import write_file
from zenoh_vision.messages import Parameter, ParameterList
from zenoh_vision.transport.connection import Connection
from zv.tools.param.options import DumpOptions, ListOptions, LoadOptions, NamedOptions, SetOptions
from zv.tools.param.values import assignments, described, shown, value_of
from zv.tools.shared.nodes import is_pattern, matching_nodes, missing_node
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession

ANSWER_S = 5.0
"""Time for a node to answer: one on a busy machine, or one that sets a control of a USB camera, may
take more than a second. Where there is no such node, the router says so at once."""

LEFT_OUT = "more nodes match and are left out; name a narrower pattern"


def list_(options: ListOptions, connection: Connection, output: Output) -> None:
    """Print the parameters of a node, or of all nodes."""
    pattern = options.node or "*"
    with ToolSession(connection) as session:
        found, failed = [], None
        for reply in session.ask(keys.parameters_key(session.namespace, "*")):
            try:
                found.append(reply.message(ParameterList))
            except (PayloadError, ExpectationNotMet, ParameterRefused) as error:
                failed = failed or ExpectationNotMet(f"*: the answer is {error}")
        if failed and not found:
            raise failed
        found = sorted((one for one in found if fnmatchcase(one.node, pattern)), key=_name)
        if not found:
            raise missing_node(session, pattern)
        for name, count in islice(Counter(map(_name, found)).items(), MAX_NODES):
            if count > 1:
                output.note(f"{count} nodes are called {name}; see zv doctor")
        if len(found) > MAX_NODES:
            output.note(f"{len(found) - MAX_NODES} {LEFT_OUT}")
        found = found[:MAX_NODES]
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
    for one in _chosen(options, connection):
        text = plain(one.value) if len(options.names) == 1 else toml_line(one.name, one.value)
        output.result(one.to_map(), text)


def describe(options: NamedOptions, connection: Connection, output: Output) -> None:
    """Print meaning, type, range, unit and default of parameters."""
    for one in _chosen(options, connection):
        output.result(one.to_map(), *described(one))


def set_(options: SetOptions, connection: Connection, output: Output) -> None:
    """Set parameters of a node, or of each node that a pattern matches, all or none on each.

    Raises:
        ConfigurationError: A node refuses; others that match a pattern may have changed.
        ExpectationNotMet: A node does not answer, or none matches.
    """
    texts = assignments(options.values)
    with ToolSession(connection) as session:
        if not is_pattern(options.node):
            _set(session, options.node, texts, output)
            return
        nodes, left_out = matching_nodes(session, options.node)
        if left_out:
            output.note(f"{left_out} {LEFT_OUT}")
        failures: list[VisionError] = []
        for node in nodes:
            try:
                _set(session, node, texts, output, prefix=f"{node} ")
            except (ConfigurationError, ExpectationNotMet) as error:
                output.note(str(error))
                failures.append(error)
        if failures:
            said = f"{len(failures)} of {len(nodes)} nodes that match {options.node} were not set"
            refused = any(isinstance(error, ConfigurationError) for error in failures)
            raise ConfigurationError(said) if refused else ExpectationNotMet(said)


def _set(
    session: ToolSession, node: str, texts: Mapping[str, str], output: Output, prefix: str = ""
) -> None:
    before = _ask(session, node)
    # An unknown name is sent unchanged: the node's error text is the most precise.
    known = {one.name: one for one in before.parameters}
    values = {
        name: value_of(known[name], text) if name in known else text for name, text in texts.items()
    }
    _change(session, before, values, output, prefix)


def dump(options: DumpOptions, connection: Connection, output: Output) -> None:
    """Write the parameters of a node as TOML.

    Raises:
        ConfigurationError: Both JSON and a file are wanted.
        SourceError: The file cannot be written.
    """
    if output.as_json and options.output != "-":
        raise ConfigurationError("--json prints the values, -o writes TOML: give one of them")
    found = _one_of(options.node, connection)
    if options.output == "-":
        values = {one.name: one.value for one in found.parameters}
        output.result(values, *toml_file(found).removesuffix("\n").split("\n"))
        return
    write_file(options.output, toml_file(found).encode())
    many = "parameter" if len(found.parameters) == 1 else "parameters"
    output.note(f"{len(found.parameters)} {many} written to {options.output}")


def load(options: LoadOptions, connection: Connection, output: Output) -> None:
    """Send the values of a TOML file to a node, all or none."""
    values = flattened(read_toml(options.file))
    with ToolSession(connection) as session:
        _change(session, _ask(session, options.node), values, output)


def _chosen(options: NamedOptions, connection: Connection) -> list[Parameter]:
    """Return the parameters of a node with the given names, or all.

    Raises:
        ParameterRefused: There is no such parameter; the text has the most similar name.
    """
    found = _one_of(options.node, connection)
    known = {parameter.name: parameter for parameter in found.parameters}
    for name in options.names:
        if name not in known:
            hint = suggestion(name, known, before="; ")
            raise ParameterRefused(
                f"{found.node}: there is no parameter {name!r}{hint}", ", ".join(known)
            )
    return [known[name] for name in options.names or known]


def _one_of(node: str, connection: Connection) -> ParameterList:
    with ToolSession(connection) as session:
        return _ask(session, node)


def _ask(session: ToolSession, node: str, payload: bytes | None = None) -> ParameterList:
    """Return the parameters of a node, with a payload after the change that it asks for.

    Raises:
        ConfigurationError: The name has wildcards.
        ParameterRefused: The node refuses; the text has the reason and what is allowed.
        ExpectationNotMet: It does not run, does not reply, or several programs reply.
    """
    if is_pattern(node):
        raise ConfigurationError(f"{node} has wildcards; allowed: the name of one node")
    valid = keys.is_name(node)
    key = keys.parameters_key if payload is None else keys.set_key
    asked = key(session.namespace, node)
    replies = session.ask(asked, payload, timeout_s=ANSWER_S) if valid else []
    if not replies:
        raise missing_node(session, node)
    found: list[ParameterList] = []
    errors: list[VisionError] = []
    for reply in replies:
        try:
            found.append(reply.message(ParameterList))
            if found[-1].node != node:
                raise PayloadError("wrong_node", f"of {shortened(found.pop().node)}")
        except ParameterRefused as refused:
            errors.insert(0, ParameterRefused(f"{node}: {refused.error}", refused.allowed))
        except (PayloadError, ExpectationNotMet) as error:
            errors.append(ExpectationNotMet(f"{node}: the answer is {error}"))
    refused_too = bool(errors) and isinstance(errors[0], ParameterRefused)
    if len(found) + refused_too > 1:  # an unreadable reply beside a readable one does not count
        raise ExpectationNotMet(
            f"{len(replies)} nodes are called {node}, and it is unknown which one is meant: "
            "stop all but one; zv doctor says where they run"
        )
    if not found:
        raise errors[0]
    return found[0]


def _change(
    session: ToolSession,
    before: ParameterList,
    values: Mapping[str, object],
    output: Output,
    prefix: str = "",
) -> None:
    """Set parameters and print the values that have changed; with ``--json`` all given ones.

    Each line begins with ``prefix``.

    Raises:
        ConfigurationError: No parameter can have such a value, or the node refuses.
    """
    for name, value in values.items():
        try:
            msgpack.packb(value)
        except (TypeError, ValueError, OverflowError):
            raise ConfigurationError(
                f"{before.node}: {name} = {value} is not allowed; allowed: a number, a text, true "
                "or false"
            ) from None
    after = _ask(session, before.node, msgpack.packb(dict(values)))
    was = {one.name: one.value for one in before.parameters}
    given = [one for one in after.parameters if one.name in values]
    changed = [one for one in given if one.value != was.get(one.name)]
    for one in given if output.as_json else changed:
        before_it = shown(was.get(one.name))
        output.result(one.to_map(), f"{prefix}{one.name}: {before_it} -> {shown(one.value)}")
    same = len(given) - len(changed)
    rest = f"; {same} value{'s' if same > 1 else ''} unchanged" if same else ""
    output.note(f"{after.node} is at revision {after.revision}{rest}")


def _name(found: ParameterList) -> str:
    return found.node
