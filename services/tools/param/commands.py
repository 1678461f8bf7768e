"""The commands of ``zv param``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from common.connection import Connection
from common.errors import SourceError
from common.messages import ParameterList
from common.parameter_text import may_be, plain, toml_file, toml_line
from common.settings import read_toml
from services.tools.output import Output
from services.tools.param.options import (
    DumpOptions,
    ListOptions,
    LoadOptions,
    NamedOptions,
    SetOptions,
)
from services.tools.param.remote import all_parameters, change, chosen, parameters_of
from services.tools.param.values import (
    assignments,
    described,
    shown,
    value_of,
)
from services.tools.session import ToolSession


def list_(options: ListOptions, connection: Connection, output: Output) -> None:
    """Show the parameters of a node, or of all."""
    with ToolSession(connection) as session:
        if options.node is None:
            found = all_parameters(session)
        else:
            found = [parameters_of(session, options.node)]
    parameters = [parameter for one in found for parameter in one.parameters]
    if output.as_json:
        for parameter in parameters:
            output.record(parameter.to_map())
        return
    output.table(
        ["node", "parameter", "value", "default", "unit", "allowed"],
        [
            [
                parameter.node,
                parameter.name,
                None if parameter.value is None else plain(parameter.value),
                None if parameter.default is None else plain(parameter.default),
                parameter.unit or "",
                may_be(parameter),
            ]
            for parameter in parameters
        ],
    )


def get(options: NamedOptions, connection: Connection, output: Output) -> None:
    """Print one value as it is, several with their names."""
    with ToolSession(connection) as session:
        parameters = chosen(parameters_of(session, options.node), options.names)
    for parameter in parameters:
        if output.as_json:
            output.record(parameter.to_map())
        elif len(options.names) == 1:
            output.line(plain(parameter.value))
        else:
            output.line(toml_line(parameter))


def describe(options: NamedOptions, connection: Connection, output: Output) -> None:
    """Print all there is to say of some parameters."""
    with ToolSession(connection) as session:
        parameters = chosen(parameters_of(session, options.node), options.names)
    for parameter in parameters:
        if output.as_json:
            output.record(parameter.to_map())
        else:
            output.line("\n".join(described(parameter)))


def set_(options: SetOptions, connection: Connection, output: Output) -> None:
    """Set some parameters, all or none."""
    texts = assignments(options.values)
    with ToolSession(connection) as session:
        before = parameters_of(session, options.node)
        # What is no parameter goes along as it is: the node says best what is wrong with it.
        known = {one.name: one for one in before.parameters}
        values = {
            name: value_of(known[name], text) if name in known else text
            for name, text in texts.items()
        }
        after = change(session, options.node, values)
    _report(before, after, values, output)


def dump(options: DumpOptions, connection: Connection, output: Output) -> None:
    """Write the parameters of a node as TOML."""
    with ToolSession(connection) as session:
        found = parameters_of(session, options.node)
    if output.as_json:
        output.record({one.name: one.value for one in found.parameters})
    elif options.output == "-":
        output.line(toml_file(found).removesuffix("\n"))
    else:
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
        before = parameters_of(session, options.node)
        after = change(session, options.node, values)
    _report(before, after, values, output)


def _report(
    before: ParameterList, after: ParameterList, values: Mapping[str, object], output: Output
) -> None:
    """Say what has changed."""
    was = {one.name: one.value for one in before.parameters}
    given = [one for one in after.parameters if one.name in values]
    changed = [one for one in given if one.value != was[one.name]]
    for one in given if output.as_json else changed:
        if output.as_json:
            output.record(one.to_map())
        else:
            output.line(f"{one.name}: {shown(was[one.name])} -> {shown(one.value)}")
    same = len(given) - len(changed)
    rest = f"; {same} value{'s' if same > 1 else ''} as before" if same else ""
    output.note(f"{after.node} is at revision {after.revision}{rest}")
