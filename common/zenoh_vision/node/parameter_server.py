"""A node's parameters on the network: queries read and set them, changes are published."""

from __future__ import annotations

import logging
import time
from typing import Any

import zenoh

from zenoh_vision import keys
from zenoh_vision.config.parameters import live_fields, no_parameter, parameter
from zenoh_vision.config.revisions import Change, ParameterStore, Revision
from zenoh_vision.config.settings import Settings
from zenoh_vision.error_text import shortened
from zenoh_vision.errors import ParameterRefused, PayloadError
from zenoh_vision.message_codec import Message, unpack
from zenoh_vision.messages import Parameter, ParameterList, Refusal
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.publisher import MESSAGE_DELIVERY

MAX_BYTES = 1 << 16
"""Largest payload of a query: many times what all parameters of a node need."""

BURST_S = 1.0
MAX_LOGGED = 10
"""Most changes logged within ``BURST_S``; the next one logged says how many were left out."""

ENCODINGS = ("application/msgpack", "zenoh/bytes", "application/octet-stream")
"""Allowed encodings of a query's payload. The second is Zenoh's default."""

MESSAGES = (Parameter, ParameterList, Refusal)


class ParameterServer:
    """Answers queries for the live settings of one node.

    ``@{ns}/param/{node}/{name}`` is one parameter, ``@{ns}/param/{node}`` are all of them. A
    query without payload reads what its key expression matches. One with a msgpack payload, a
    value or a map of values, sets first. A refusal is an error reply, and changes nothing.
    """

    def __init__(self, store: ParameterStore[Any], namespace: str, node: str) -> None:
        self.key = f"{keys.parameters_key(namespace, node)}/**"
        self._store = store
        self._node = node
        self._own_key = keys.parameters_key(namespace, node)
        settings: Settings = store.newest.settings
        self._model = settings.__class__
        self._names = {
            keys.parameter_key(namespace, node, name): name for name in live_fields(self._model)
        }
        self._log = logging.getLogger(node)
        self._burst_s = 0.0
        self._logged = self._unlogged = 0

    def publish_changes(self, link: Link) -> None:
        """Publish and log each change from now on."""
        congestion_control, priority = MESSAGE_DELIVERY

        def on_change(change: Change[Any]) -> None:
            self._log_change(change)
            for key, name in self._names.items():
                if name in change.names:
                    link.session.put(
                        key,
                        self._parameter(name, change.after).to_bytes(),
                        encoding=keys.msgpack_of(Parameter.schema_name),
                        congestion_control=congestion_control,
                        priority=priority,
                    )

        self._store.watch(on_change)

    def answer(self, query: zenoh.Query) -> None:
        """Answer a query."""
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
        """Return the messages that answer a query, each with its key.

        Raises:
            ParameterRefused: There is no such parameter, or the payload is not allowed.
        """
        asked = str(expression)
        revision = self._store.newest if payload is None else self._set(asked, payload)
        found: list[tuple[str, Message]] = []
        if expression.intersects(zenoh.KeyExpr(self._own_key)):
            parameters = tuple(self._parameter(name, revision) for name in self._names.values())
            number = revision.number
            listed = ParameterList(node=self._node, revision=number, parameters=parameters)
            found.append((self._own_key, listed))
        for key, name in self._names.items():
            if expression.intersects(zenoh.KeyExpr(key)):
                found.append((key, self._parameter(name, revision)))
        if not found and "*" not in asked:
            raise self._unknown(asked)
        return found

    def _set(self, asked: str, payload: bytes) -> Revision[Any]:
        name = self._names.get(asked)
        if asked != self._own_key and name is None:
            raise self._unknown(asked)
        allowed = "a msgpack map of names to values" if name is None else "a msgpack value"
        try:
            value = unpack(payload)
        except PayloadError as error:
            raise ParameterRefused(error.detail, allowed) from None
        values = value if name is None else {name: value}
        if isinstance(values, dict):
            return self._store.change(values).after
        raise ParameterRefused(
            f"one value ({type(value).__name__}) cannot set all parameters", allowed
        )

    def _unknown(self, asked: str) -> ParameterRefused:
        if "*" in asked:
            names = ", ".join(self._names.values())
            return ParameterRefused("a change must name its parameter without *", names)
        return no_parameter(self._model, asked.removeprefix(f"{self._own_key}/"))

    def _parameter(self, name: str, revision: Revision[Any]) -> Parameter:
        return parameter(self._node, revision.settings, name, revision.number)

    def _log_change(self, change: Change[Any]) -> None:
        now_s = time.monotonic()
        if now_s - self._burst_s > BURST_S:
            self._burst_s, self._logged = now_s, 0
        if self._logged >= MAX_LOGGED:
            self._unlogged += 1
            return
        changes = (
            f"{name} {shortened(getattr(change.before.settings, name))} -> "
            f"{shortened(getattr(change.after.settings, name))}"
            for name in change.names
        )
        before = f"; {self._unlogged} changes before it were not logged" if self._unlogged else ""
        self._log.info("%s (revision %d%s)", ", ".join(changes), change.after.number, before)
        self._logged, self._unlogged = self._logged + 1, 0


def payload_of(query: zenoh.Query) -> bytes | None:
    """Return a query's payload; None if it has none.

    Raises:
        ParameterRefused: It is too large, which is found before it is copied, or its encoding is
            not msgpack: read as msgpack, the text ``5`` would be the number 53.
    """
    if query.payload is None:
        return None
    encoding = str(query.encoding).partition(";")[0]
    if encoding not in ENCODINGS:
        raise ParameterRefused(f"a payload of {encoding[:80]}", " or ".join(ENCODINGS))
    if len(query.payload) > MAX_BYTES:
        raise ParameterRefused(f"a payload of {len(query.payload)} bytes", f"at most {MAX_BYTES}")
    return query.payload.to_bytes()
