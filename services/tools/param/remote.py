"""The parameters of a node somewhere on the network: read them, change them."""

from __future__ import annotations

from collections.abc import Mapping

import msgpack
import zenoh

from common import keys
from common.errors import (
    ConfigurationError,
    ExpectationNotMet,
    ParameterRefused,
    PayloadError,
)
from common.messages import Parameter, ParameterList, Refusal
from common.near_names import meant
from services.tools.nodes import absent
from services.tools.session import ToolSession

ASKED_FOR = "parameters"


def all_parameters(session: ToolSession) -> list[ParameterList]:
    """Return the parameters of every node, in the order of their names.

    Raises:
        ExpectationNotMet: No node has any.
    """
    replies = session.ask(keys.parameters_key(session.namespace, "*"))
    found = [listed(reply) for reply in replies]
    if not found:
        raise absent(session, "*", ASKED_FOR)
    return sorted(found, key=lambda one: one.node)


def parameters_of(session: ToolSession, node: str) -> ParameterList:
    """Return the parameters of a node.

    Raises:
        ExpectationNotMet: It is not there, or does not answer.
    """
    return _ask(session, node, None)


def change(session: ToolSession, node: str, values: Mapping[str, object]) -> ParameterList:
    """Set parameters of a node, all or none, and return what holds then.

    Raises:
        ConfigurationError: The node refuses; says why and what is allowed.
        ExpectationNotMet: It is not there, or does not answer.
    """
    for name, value in values.items():
        try:
            msgpack.packb(value)
        except (TypeError, ValueError, OverflowError):
            raise ConfigurationError(
                f"{node}: {name} = {value} is not allowed; allowed: a number, a text, true or false"
            ) from None
    return _ask(session, node, msgpack.packb(dict(values)))


def chosen(found: ParameterList, names: tuple[str, ...]) -> list[Parameter]:
    """Return the parameters of these names, all if there are none.

    Raises:
        ConfigurationError: There is no such parameter; names the nearest.
    """
    known = {parameter.name: parameter for parameter in found.parameters}
    for name in names:
        if name not in known:
            raise ParameterRefused(
                f"{found.node}: there is no parameter {name!r}{meant(name, known, before='; ')}",
                ", ".join(known),
            )
    return [known[name] for name in names or known]


def listed(reply: zenoh.Reply) -> ParameterList:
    """Return what a node replied.

    Raises:
        ParameterRefused: It refused.
        ExpectationNotMet: It said something else.
    """
    if reply.ok is not None:
        try:
            return ParameterList.from_bytes(reply.ok.payload.to_bytes())
        except PayloadError as error:
            raise ExpectationNotMet(f"{reply.ok.key_expr}: the answer is {error}") from None
    assert reply.err is not None
    payload = reply.err.payload.to_bytes()
    try:
        refusal = Refusal.from_bytes(payload)
    except PayloadError:
        raise ExpectationNotMet(payload.decode(errors="replace")) from None
    raise ParameterRefused(refusal.error, refusal.allowed)


def _ask(session: ToolSession, node: str, payload: bytes | None) -> ParameterList:
    if not keys.is_name(node):
        raise absent(session, node, ASKED_FOR)
    replies = session.ask(
        keys.parameters_key(session.namespace, node),
        payload,
        encoding=None if payload is None else "application/msgpack",
    )
    if not replies:
        raise absent(session, node, ASKED_FOR)
    try:
        return listed(replies[0])
    except ParameterRefused as refused:
        raise ParameterRefused(f"{node}: {refused.error}", refused.allowed) from None
