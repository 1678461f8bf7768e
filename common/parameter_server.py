"""A node's parameters on the network: queries that read and set, and a word on each change."""

from __future__ import annotations

import logging
from typing import Any

import zenoh

from common import keys
from common.codec import Message, unpack
from common.errors import ParameterRefused, PayloadError
from common.link import Link
from common.live import Change, LiveSettings, Revision
from common.messages import Parameter, ParameterList, Refusal
from common.parameters import live_fields, no_parameter, parameter
from common.publishing import MESSAGE_DELIVERY
from common.settings import Settings

MAX_BYTES = 1 << 16
"""Of a query's payload: many times what all parameters of a node need."""

ENCODINGS = ("application/msgpack", "zenoh/bytes", "application/octet-stream")
"""What a query's payload may say that it is. The second is what Zenoh says if nobody does."""

MESSAGES = (Parameter, ParameterList, Refusal)


class ParameterServer:
    """Answers for the live settings of one node.

    ``@{ns}/param/{node}/{name}`` is one parameter, ``@{ns}/param/{node}`` are all of them. A
    query without payload reads whatever its key expression matches. With a msgpack payload, a
    value or a map of values, it sets first. A refusal is an error reply, and changes nothing.

    Args:
        live: The settings.
        namespace: First chunk of the keys.
        node: The node's name.
    """

    def __init__(self, live: LiveSettings[Any], namespace: str, node: str) -> None:
        self.key = f"{keys.parameters_key(namespace, node)}/**"
        self._live = live
        self._node = node
        self._own_key = keys.parameters_key(namespace, node)
        settings: Settings = live.newest.settings
        self._model = settings.__class__
        self._names = {
            keys.parameter_key(namespace, node, name): name for name in live_fields(self._model)
        }
        self._log = logging.getLogger(node)

    def publish_to(self, link: Link) -> None:
        """Publish and log each change from now on."""
        congestion_control, priority = MESSAGE_DELIVERY

        def on_change(change: Change[Any]) -> None:
            self._say(change)
            for key, name in self._names.items():
                if name in change.names:
                    link.session.put(
                        key,
                        self._parameter(name, change.after).to_bytes(),
                        encoding=keys.msgpack_of(Parameter.schema_name),
                        congestion_control=congestion_control,
                        priority=priority,
                    )

        self._live.watch(on_change)

    def answer(self, query: zenoh.Query) -> None:
        """Answer one query, whatever is in it."""
        try:
            replies = self.replies(query.key_expr, payload_of(query))
        except ParameterRefused as refused:
            refusal = Refusal(error=refused.error, allowed=refused.allowed)
            query.reply_err(refusal.to_bytes(), encoding=keys.msgpack_of(Refusal.schema_name))
            return
        for key, message in replies:
            query.reply(key, message.to_bytes(), encoding=keys.msgpack_of(message.schema_name))

    def replies(
        self, expression: zenoh.KeyExpr, payload: bytes | None
    ) -> list[tuple[str, Message]]:
        """Return what a query is answered with, each with its key.

        Raises:
            ParameterRefused: There is no such parameter, or the payload is not allowed.
        """
        asked = str(expression)
        revision = self._live.newest if payload is None else self._set(asked, payload)
        found: list[tuple[str, Message]] = []
        if expression.intersects(zenoh.KeyExpr(self._own_key)):
            every = tuple(self._parameter(name, revision) for name in self._names.values())
            listed = ParameterList(node=self._node, revision=revision.number, parameters=every)
            found.append((self._own_key, listed))
        for key, name in self._names.items():
            if expression.intersects(zenoh.KeyExpr(key)):
                found.append((key, self._parameter(name, revision)))
        if not found and "*" not in asked:
            raise self._unknown(asked)
        return found

    def _set(self, asked: str, payload: bytes) -> Revision[Any]:
        one = self._names.get(asked)
        if asked != self._own_key and one is None:
            raise self._unknown(asked)
        try:
            value = unpack(payload)
        except PayloadError as error:
            right = "a msgpack map of names to values" if one is None else "a msgpack value"
            raise ParameterRefused(error.detail, right) from None
        if one is not None:
            return self._live.change({one: value}).after
        if isinstance(value, dict):
            return self._live.change(value).after
        raise ParameterRefused(
            f"one value ({type(value).__name__}) cannot set all parameters",
            "a msgpack map of names to values",
        )

    def _unknown(self, asked: str) -> ParameterRefused:
        if "*" in asked:
            names = ", ".join(self._names.values())
            return ParameterRefused("a change must name its parameter without *", names)
        return no_parameter(self._model, asked.removeprefix(f"{self._own_key}/"))

    def _parameter(self, name: str, revision: Revision[Any]) -> Parameter:
        return parameter(self._node, revision.settings, name, revision.number)

    def _say(self, change: Change[Any]) -> None:
        steps = (
            f"{name} {getattr(change.before.settings, name)!r} -> "
            f"{getattr(change.after.settings, name)!r}"
            for name in change.names
        )
        self._log.info("%s (revision %d)", ", ".join(steps), change.after.number)


def payload_of(query: zenoh.Query) -> bytes | None:
    """Return a query's payload; None if it has none.

    Raises:
        ParameterRefused: It is larger than any that could be right, and then it is not copied;
            or its encoding says that it is no msgpack: the text ``5`` would be the number 53.
    """
    if query.payload is None:
        return None
    encoding = str(query.encoding).partition(";")[0]
    if encoding not in ENCODINGS:
        raise ParameterRefused(f"a payload of {encoding[:80]}", " or ".join(ENCODINGS))
    if len(query.payload) > MAX_BYTES:
        raise ParameterRefused(f"a payload of {len(query.payload)} bytes", f"at most {MAX_BYTES}")
    return query.payload.to_bytes()
