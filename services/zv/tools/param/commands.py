"""The commands of ``zv param``: list, get, describe, set, dump and load."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import islice
from pathlib import Path

import msgpack

from zenoh_vision import keys
from zenoh_vision.config.constraints import Value, limits, plain, toml_file, toml_line
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
from zv.tools.param.values import assignments, described, shown, value_of
from zv.tools.shared.nodes import is_pattern, matching_nodes, missing_node, places_by_session
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession

MAX_TOLD = 5
"""Most programs that answer for one node that are listed."""

LEFT_OUT = "more nodes match and are left out; name a narrower pattern"


@dataclass(frozen=True, slots=True)
class Answers:
    """The answers to a query for the parameters of a node, or of all nodes.

    Attributes:
        replies: All that came, at least one.
        found: The parameters in them, each with its reply.
        failed: An error among the replies, a refusal if there is one; None without errors.
    """

    replies: list[Reply]
    found: list[tuple[Reply, ParameterList]]
    failed: VisionError | None

    def matching(self, pattern: str) -> Answers:
        """Return the answers of the nodes that match a pattern.

        An error does not say which node sent it, so it counts only if no node could be read.
        """
        found = [(reply, one) for reply, one in self.found if fnmatchcase(one.node, pattern)]
        return Answers(self.replies, found, None if self.found else self.failed)

    def checked(self) -> list[ParameterList]:
        """Return the parameters of each node, at most ``MAX_NODES``.

        Anyone can answer for a node, and it is unknown which answer is true. A refusal counts; an
        unreadable reply does not if another can be read.

        Raises:
            ParameterRefused: A node refuses; the text has the reason and what is allowed.
            ExpectationNotMet: No reply has parameters.
        """
        failed = self.failed
        if failed is not None and (not self.found or isinstance(failed, ParameterRefused)):
            raise failed
        return sorted((one for _, one in self.found), key=lambda one: one.node)[:MAX_NODES]


def list_(options: ListOptions, connection: Connection, output: Output) -> None:
    """Print the parameters of a node, or of all nodes."""
    with ToolSession(connection) as session:
        pattern = options.node or "*"
        answers = _ask(session, pattern, several=True)
        names = Counter(one.node for _, one in answers.found)
        for name, count in islice(names.items(), MAX_NODES):
            if count > 1:
                output.note(f"{count} nodes are called {name}; see zv node list")
        found = answers.checked()
        if not found:
            raise missing_node(session, pattern, "parameters")
        if left_out := len(answers.found) - len(found):
            output.note(f"{left_out} {LEFT_OUT}")
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
    known = {one.name: one for one in before.checked()[0].parameters}
    values = {
        name: value_of(known[name], text) if name in known else text for name, text in texts.items()
    }
    _change(session, node, before, values, output, prefix)


def dump(options: DumpOptions, connection: Connection, output: Output) -> None:
    """Write the parameters of a node as TOML."""
    found = _one_of(options.node, connection, output)
    if output.as_json or options.output == "-":
        values = {one.name: one.value for one in found.parameters}
        output.result(values, *toml_file(found).removesuffix("\n").split("\n"))
        return
    try:
        Path(options.output).write_text(toml_file(found), encoding="utf-8")
    except OSError as error:
        raise SourceError(f"{options.output}: {error.strerror or error}") from None
    many = "parameter" if len(found.parameters) == 1 else "parameters"
    output.note(f"{len(found.parameters)} {many} written to {options.output}")


def load(options: LoadOptions, connection: Connection, output: Output) -> None:
    """Send the values of a TOML file to a node, all or none."""
    values = read_toml(options.file)
    with ToolSession(connection) as session:
        _change(session, options.node, _ask(session, options.node), values, output)


def _chosen(options: NamedOptions, connection: Connection, output: Output) -> list[Parameter]:
    """Return the parameters of a node with the given names, or all.

    Raises:
        ParameterRefused: There is no such parameter; the text has the most similar name.
    """
    found = _one_of(options.node, connection, output)
    known = {parameter.name: parameter for parameter in found.parameters}
    for name in options.names:
        if name not in known:
            hint = suggestion(name, known, before="; ")
            raise ParameterRefused(
                f"{found.node}: there is no parameter {name!r}{hint}", ", ".join(known)
            )
    return [known[name] for name in options.names or known]


def _one_of(node: str, connection: Connection, output: Output) -> ParameterList:
    """Return the parameters of a node; if several have its name, print whose they are."""
    with ToolSession(connection) as session:
        answers = _ask(session, node)
        if len(answers.replies) > 1:
            places = places_by_session(session, node)
            said = f"{len(answers.replies)} nodes are called {node}"
            for shown, _ in answers.found[:1]:
                others = [_place(each, places) for each in answers.replies if each is not shown]
                said += (
                    f"; this is the answer of {_place(shown, places)}, not of "
                    f"{', '.join(others[:MAX_TOLD])}"
                )
            output.note(f"{said}; see zv node list")
    (found, *_) = answers.checked()
    return found


def _ask(
    session: ToolSession, node: str, payload: bytes | None = None, *, several: bool = False
) -> Answers:
    """Query the parameters of a node, or of all nodes that match a pattern.

    Args:
        session: An open session.
        node: The name of a node, or a pattern if there may be several.
        payload: A change of parameters, which each node of the name makes before it replies.
        several: Whether a pattern is allowed.

    Raises:
        ConfigurationError: It has wildcards that are not allowed.
        ExpectationNotMet: It does not run, or does not reply.
    """
    chosen = None if several and is_pattern(node) else node
    if chosen is not None and is_pattern(chosen):
        raise ConfigurationError(f"{node} has wildcards; allowed: the name of one node")
    replies: list[Reply] = []
    if chosen is None or keys.is_name(chosen):
        replies = session.ask(keys.parameters_key(session.namespace, chosen or "*"), payload)
    if not replies:
        raise missing_node(session, node, "parameters")
    answers = Answers(replies, *_read(replies, chosen))
    return answers.matching(node) if chosen is None else answers


def _read(
    replies: Iterable[Reply], node: str | None
) -> tuple[list[tuple[Reply, ParameterList]], VisionError | None]:
    """Return the parameters in replies, and an error among them: a refusal if there is one."""
    found: list[tuple[Reply, ParameterList]] = []
    refusal: VisionError | None = None
    failed: VisionError | None = None
    for reply in replies:
        try:
            one = reply.message(ParameterList)
            if node not in (None, one.node):
                raise PayloadError("wrong_node", f"of {shortened(one.node)}")
            found.append((reply, one))
        except ParameterRefused as refused:
            refusal = ParameterRefused(f"{node or '*'}: {refused.error}", refused.allowed)
        except PayloadError as error:
            failed = failed or ExpectationNotMet(f"{node or '*'}: the answer is {error}")
        except ExpectationNotMet as error:
            failed = failed or error
    return found, refusal or failed


def _change(
    session: ToolSession,
    node: str,
    before: Answers,
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
                f"{node}: {name} = {value} is not allowed; allowed: a number, a text, true or false"
            ) from None
    before.checked()
    answers = _ask(session, node, msgpack.packb(dict(values)))
    if len(answers.replies) > 1:
        _tell_of_several(session, node, before, answers, values, output)
    (after, *_) = answers.checked()
    was = _values(before, answers.found[0][0].session)
    given = [one for one in after.parameters if one.name in values]
    changed = [one for one in given if one.value != was.get(one.name)]
    for one in given if output.as_json else changed:
        before_it = shown(was.get(one.name))
        output.result(one.to_map(), f"{prefix}{one.name}: {before_it} -> {shown(one.value)}")
    same = len(given) - len(changed)
    rest = f"; {same} value{'s' if same > 1 else ''} unchanged" if same else ""
    output.note(f"{after.node} is at revision {after.revision}{rest}")


def _values(answers: Answers, session: str) -> dict[str, Value]:
    """Return the values that a session answered, or the first answer's if it did not answer."""
    mine = [one for reply, one in answers.found if reply.session == session]
    (chosen, *_) = mine or [one for _, one in answers.found]
    return {one.name: one.value for one in chosen.parameters}


def _tell_of_several(
    session: ToolSession,
    node: str,
    before: Answers,
    after: Answers,
    values: Mapping[str, object],
    output: Output,
) -> None:
    """Print that several nodes of a name were asked to change, and the outcome of each."""
    places = places_by_session(session, node)
    read = {id(reply): one for reply, one in after.found}
    told = []
    for reply in after.replies[:MAX_TOLD]:
        one = read.get(id(reply))
        if one is None:
            what = "refused, or cannot be read"
        else:
            was = _values(before, reply.session)
            now = {each.name: each.value for each in one.parameters if each.name in values}
            changes = [f"{name} {shown(was.get(name))} -> {shown(now[name])}" for name in now]
            what = ", ".join([*changes, f"revision {one.revision}"])
        told.append(f"{_place(reply, places)} ({what})")
    count = len(after.replies)
    every = "both" if count == 2 else "all"
    changed = f" and {every} were set" if len(read) == count else ""
    output.note(f"{count} nodes are called {node}{changed}: {', '.join(told)}; see zv node list")


def _place(reply: Reply, places: Mapping[str, str]) -> str:
    """Return where the node that sent a reply runs."""
    return places.get(reply.session) or f"session {reply.session or '?'}"
