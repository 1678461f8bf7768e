"""A node's parameters on the network: queries read and set them, changes are published."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import zenoh

from zenoh_vision import keys
from zenoh_vision.config.parameters import live_fields, no_parameter, parameter
from zenoh_vision.config.revisions import Change, ParameterStore, Revision
from zenoh_vision.config.settings import Settings
from zenoh_vision.error_text import shortened
from zenoh_vision.errors import ParameterRefused, PayloadError
from zenoh_vision.host.clock import SYSTEM_CLOCK, Clock
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

    ``@{ns}/param/{node}/{name}`` is one parameter, ``@{ns}/param/{node}`` are all of them: a query
    reads what its key expression matches. ``@{ns}/set/{node}/{name}`` and ``@{ns}/set/{node}`` set,
    to a msgpack value or a map of values, and answer with what is read afterwards. Two keys, since
    access rules see keys, but no payloads. A refusal is an error reply, and changes nothing.

    Attributes:
        key: Key expression of the queries that read.
        set_key: Key expression of the queries that set.
    """

    def __init__(
        self, store: ParameterStore[Any], namespace: str, node: str, clock: Clock = SYSTEM_CLOCK
    ) -> None:
        self._clock = clock
        self._store = store
        self._node = node
        self._own_key = keys.parameters_key(namespace, node)
        self._own_set_key = keys.set_key(namespace, node)
        self.key = f"{self._own_key}/**"
        self.set_key = f"{self._own_set_key}/**"
        settings: Settings = store.newest.settings
        self._model = settings.__class__
        self._names = tuple(live_fields(self._model))
        self._log = logging.getLogger(node)
        self._burst_s = 0.0
        self._logged = self._unlogged = 0

    def publish_changes(self, link: Link) -> Callable[[], None]:
        """Publish and log each change from now on; a parameter that is gone is deleted.

        Returns:
            Ends it, before the session is closed.
        """
        congestion_control, priority = MESSAGE_DELIVERY

        def on_change(change: Change[Any]) -> None:
            self._log_change(change)
            delivery: dict[str, Any] = {
                "congestion_control": congestion_control,
                "priority": priority,
            }
            there = self._all(change.after)
            for name in change.names:
                if name in there:
                    link.session.put(
                        self._key(name),
                        self._parameter(name, change.after).to_bytes(),
                        encoding=keys.msgpack_of(Parameter.schema_name),
                        **delivery,
                    )
                else:
                    link.session.delete(self._key(name), **delivery)

        self._store.watch(on_change)
        return lambda: self._store.unwatch(on_change)

    def answer(self, query: zenoh.Query) -> None:
        """Answer a query that reads or sets, by its key.

        Raises:
            ParameterRefused: There is no such parameter, or the payload is not allowed.
        """
        expression = query.key_expr
        if expression.intersects(zenoh.KeyExpr(self.set_key)):
            replies = [self._set(str(expression), payload_of(query))]
        elif query.payload is None:
            replies = self._read(expression)
        else:
            raise self._other_key(str(expression))
        for key, message in replies:
            query.reply(key, message.to_bytes(), encoding=keys.msgpack_of(message.schema_name))

    def _read(self, expression: zenoh.KeyExpr) -> list[tuple[str, Message]]:
        """Return the messages that a key expression matches, each with its key.

        Raises:
            ParameterRefused: There is no such parameter.
        """
        asked = str(expression)
        revision = self._store.current()
        found: list[tuple[str, Message]] = []
        if expression.intersects(zenoh.KeyExpr(self._own_key)):
            found.append((self._own_key, self._list(revision)))
        for name in self._all(revision):
            if expression.intersects(zenoh.KeyExpr(self._key(name))):
                found.append((self._key(name), self._parameter(name, revision)))
        if not found and "*" not in asked:
            raise self._no_parameter(asked.removeprefix(f"{self._own_key}/"), revision)
        return found

    def _set(self, asked: str, payload: bytes | None) -> tuple[str, Message]:
        """Set what the payload says, and return the message that answers, with its key.

        Raises:
            ParameterRefused: There is no such parameter, or the payload is not allowed.
        """
        newest = self._store.newest
        names = self._all(newest)
        if "*" in asked:
            raise ParameterRefused("a change must name its parameter without *", ", ".join(names))
        name = asked.removeprefix(f"{self._own_set_key}/") if asked != self._own_set_key else None
        if name is not None and name not in names:
            raise self._no_parameter(name, newest)
        allowed = "a msgpack map of names to values" if name is None else "a msgpack value"
        if payload is None:
            read = asked.replace("/set/", "/param/", 1)
            raise ParameterRefused("a change without a value", f"{allowed}; {read} reads")
        try:
            value = unpack(payload)
        except PayloadError as error:
            raise ParameterRefused(error.detail, allowed) from None
        values = value if name is None else {name: value}
        if not isinstance(values, dict):
            raise ParameterRefused(
                f"one value ({type(value).__name__}) cannot set all parameters", allowed
            )
        revision = self._store.change(values).after
        return asked, self._list(revision) if name is None else self._parameter(name, revision)

    def _other_key(self, asked: str) -> ParameterRefused:
        where = asked.replace("/param/", "/set/", 1)
        return ParameterRefused(
            f"{asked} only reads parameters; a change is sent to {where}",
            f"a query without payload, or this payload on {where}",
        )

    def _list(self, revision: Revision[Any]) -> ParameterList:
        parameters = tuple(self._parameter(name, revision) for name in self._all(revision))
        return ParameterList(node=self._node, revision=revision.number, parameters=parameters)

    def _all(self, revision: Revision[Any]) -> tuple[str, ...]:
        """Return the names of the options and of the parameters of groups."""
        return *self._names, *revision.grouped

    def _key(self, name: str) -> str:
        return f"{self._own_key}/{name}"

    def _no_parameter(self, name: str, revision: Revision[Any]) -> ParameterRefused:
        return no_parameter(self._model, name, revision.grouped)

    def _parameter(self, name: str, revision: Revision[Any]) -> Parameter:
        one = revision.grouped.get(name)
        if one is not None:
            return one.model_copy(update={"node": self._node, "revision": revision.number})
        return parameter(self._node, revision.settings, name, revision.number)

    def _log_change(self, change: Change[Any]) -> None:
        now_s = self._clock.monotonic_ns() / 1e9
        if now_s - self._burst_s > BURST_S:
            self._burst_s, self._logged = now_s, 0
        if self._logged >= MAX_LOGGED:
            self._unlogged += 1
            return
        there = change.before.grouped.keys() & change.after.grouped.keys()
        changes = [
            f"{name} {shortened(change.before.value(name))} -> "
            f"{shortened(change.after.value(name))}"
            for name in change.names
            if (name in there or name in self._names)
            and change.before.value(name) != change.after.value(name)
        ]
        if not changes:  # parameters came or went, which is said by who brings them
            return
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
