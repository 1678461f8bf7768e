"""Keeps the system state up to date: follows tokens, health and parameters, queries new nodes."""

from __future__ import annotations

import asyncio
import itertools
import json
import logging
import time
from collections.abc import Iterator, Mapping
from typing import TypeVar
from weakref import WeakValueDictionary

import msgpack

from zenoh_vision import keys
from zenoh_vision.error_text import joined
from zenoh_vision.errors import ExpectationNotMet, ParameterRefused, PayloadError
from zenoh_vision.health.fleet import Event, ParameterGone
from zenoh_vision.health.fleet_monitor import Kind, follow
from zenoh_vision.messages import MESSAGES, NodeDescription, Parameter, ParameterList
from zenoh_vision.topics import misnamed_camera
from zenoh_vision.transport.declarations import (
    ROUTERS,
    declaration_in,
    declared_key,
    session_ids,
)
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.query import Reply, messages_in
from zv.viewer.discovery.network import Key, Mailbox, Network, in_slices
from zv.viewer.discovery.system_state import SystemState
from zv.viewer.topics import MAX_CHARACTERS, is_stream

log = logging.getLogger("viewer")

TICK_S = 0.5
TELL_EVERY = 4
"""Ticks between two messages that show pages that the connection is alive."""

DESCRIBE_EVERY = 10
"""Ticks between two queries for all descriptions, since a node's subscriptions change."""

LOOK_EVERY = 4
"""Ticks between two queries for the routers' sessions. Zenoh 1.10 can hang a router that is queried
for its publishers while one is being declared (zenoh #2619). So it is queried when sessions were
opened or closed, but none since the last tick, and otherwise rarely."""

LIST_AGAIN_S = 60.0

LIST_BYTES = 8 << 20
"""Limit of the routers' lists: some 7000 keys."""

SETTLE_S = 0.1
SETTLE_NODE_S = 0.0005
"""Events within this time, and more for each node listed, cause one query for descriptions and one
message to pages."""

MAX_DESCRIPTION_BYTES = 128 << 10
"""Limit of a description or parameter list. They have some kB; decoding more blocks the loop."""

ASK_AGAIN_S = 1.0
ANSWER_S = 1.5
SET_S = 5.0
"""Time for a node to make a change: a control of a USB camera may take a second."""

M = TypeVar("M", NodeDescription, ParameterList)
KINDS: tuple[Kind, ...] = ("token", "diagnostics", "parameter")
ROUTER = ("", bool, "")
"""Key in the mailbox for changes of the connection to the router."""


class Unanswered(Exception):
    """A node did not answer."""


class SystemMonitor:
    """Keeps a ``SystemState`` up to date; on the event loop.

    Attributes:
        pages: How many pages are open.
    """

    def __init__(self, system: SystemState, network: Network) -> None:
        self.system = system
        self.network = network
        self.pages = 0
        self._namespace = system.namespace
        self._mailbox = Mailbox(network.loop, self._take)
        self._asking: dict[str, asyncio.Task[None]] = {}
        self._listing: asyncio.Task[None] | None = None
        self._sessions = self._listed_of = frozenset[str]()
        self._list_again_s = 0.0
        self._settling = False
        # One change of a node at a time, so that none comes between a check and its change.
        self._locks = WeakValueDictionary[str, asyncio.Lock]()

    def begin(self) -> None:
        """Subscribe, now that there is a session."""
        self.network.do(lambda link: follow(link, self._namespace, KINDS, self._post, _reject))

    async def run(self) -> None:
        """Watch the router and query the nodes forever."""
        for turn in itertools.count(1):
            self.network.do(self._check_router)
            if turn % DESCRIBE_EVERY == 0 and (self.pages or self.system.fleet.left_out):
                self._ask("*")
            if turn % LOOK_EVERY == 0:
                self._list()
            if turn % TELL_EVERY == 0:
                self.system.tick()
            self.system.expire()
            self._settle_soon()
            await asyncio.sleep(TICK_S)

    async def set(
        self, node: str, values: Mapping[str, object], expected: Mapping[str, object]
    ) -> ParameterList:
        """Change parameters of a node, all or none, and return all parameters after the change.

        Raises:
            ParameterRefused: The node refuses, or a parameter has not the ``expected`` value.
            Unanswered: The node does not answer.
        """
        try:
            payload = msgpack.packb(dict(values))
        except (TypeError, ValueError, OverflowError):
            raise ParameterRefused(
                "a value that is none of a parameter", "a number, a text, true, false or null"
            ) from None
        async with self._locks.setdefault(node, asyncio.Lock()):
            if expected:
                known = {each.name: each.value for each in (await self.parameters(node)).parameters}
                other = [name for name, value in expected.items() if known.get(name) != value]
                if other:
                    words = f"{joined(other)} of {node} was changed meanwhile"
                    raise ParameterRefused(words, "a change of the new value")
            return await self.parameters(node, payload)

    async def parameters(self, node: str, payload: bytes | None = None) -> ParameterList:
        """Return the parameters of a node.

        Raises:
            Unanswered: The node does not answer.
            ParameterRefused: The node refuses the change in the payload.
        """
        key_of = keys.parameters_key if payload is None else keys.set_key
        key = key_of(self._namespace, node)
        time_s = ANSWER_S if payload is None else SET_S
        for reply in await self.network.ask(key, payload=payload, timeout_s=time_s):
            try:
                found = reply.message(ParameterList)
            except (PayloadError, ExpectationNotMet) as error:
                raise Unanswered(f"{node}: {error}") from None
            if found.node == node:
                return found
        raise Unanswered(f"{node} does not answer")

    async def schema(self, name: str) -> str | None:
        """Return the JSON Schema of a type of message as text; None if nobody knows it."""
        known = MESSAGES.get(name)
        if known is not None:
            return json.dumps(known.model_json_schema())
        if not keys.SCHEMA_NAME.fullmatch(name):
            return None
        for reply in await self.network.ask(
            keys.schema_key(self._namespace, name), timeout_s=ANSWER_S, most_bytes=LIST_BYTES
        ):
            if reply.ok is None or len(reply.ok.payload) > MAX_DESCRIPTION_BYTES:
                continue
            try:
                text = reply.ok.payload.to_bytes().decode()
                if isinstance(json.loads(text), dict):
                    return text
            except (ValueError, RecursionError):
                continue
        return None

    # On the network's and Zenoh's threads

    def _post(self, name: str, event: Event) -> None:
        # One kind for what came and what went, so that the newer replaces the older.
        if isinstance(event, Parameter | ParameterGone):
            self._mailbox.put((name, Parameter, event.name), event)
        else:
            self._mailbox.put((name, type(event), ""), event)

    def _check_router(self, link: Link) -> None:
        connected = link.connected
        if connected != self.system.connected:
            self._mailbox.put(ROUTER, connected)

    # On the loop

    def _take(self, key: Key, event: Event) -> None:
        if key == ROUTER:
            self.system.router(event is True)
            if event is True:
                self._ask("*")
            return
        try:
            self.system.take(key[0], event)
        except PayloadError as error:
            _reject(error)
        if isinstance(event, bool):
            self._settle_soon()

    def _settle_soon(self) -> None:
        if not self._settling:
            self._settling = True
            delay_s = SETTLE_S + SETTLE_NODE_S * len(self.system.fleet.nodes())
            self.network.loop.call_later(delay_s, self._settle)

    def _settle(self) -> None:
        self._settling = False
        # Not by the wall clock, after whose step back no node would be asked for long.
        for name in self.system.fleet.to_ask(time.monotonic_ns(), ASK_AGAIN_S):
            self._ask(name)
        self.system.flush()

    def _ask(self, node: str) -> None:
        """Begin to query a node, or all with ``*``, unless a query is in progress."""
        if node not in self._asking:
            task = self._asking[node] = self.network.loop.create_task(self._learn(node))
            task.add_done_callback(lambda _: self._asking.pop(node))

    async def _learn(self, node: str) -> None:
        """Query the description and parameters of a node, or of all nodes with ``*``."""
        described, listed = await asyncio.gather(
            self.network.ask(keys.node_key(self._namespace, node)),
            self.network.ask(keys.parameters_key(self._namespace, node)),
        )
        if described.left_out or listed.left_out:
            self.system.say_cut("nodes reply more than can be kept; some replies are left out")
        async for description in in_slices(_of_their_nodes(described, NodeDescription)):
            try:
                self.system.describe(description)
            except PayloadError as error:
                _reject(error)
        async for found in in_slices(_of_their_nodes(listed, ParameterList)):
            self.system.set_parameters(found)
        self._settle_soon()

    def _list(self) -> None:
        """Begin to query the routers for all publishers, unless a query is in progress."""
        if self._listing is None or self._listing.done():
            self._listing = self.network.loop.create_task(self._learn_publishers())

    async def _learn_publishers(self) -> None:
        """Query the routers for the keys on which anyone publishes, whether a node or not."""
        replies = await self.network.ask(ROUTERS)
        # The keys contain the routers' ids: after a router's restart, the sessions are the same.
        known = session_ids(replies)
        sessions = known | {reply.key for reply in replies}
        is_calm, self._sessions = sessions == self._sessions, sessions
        now_s = time.monotonic()
        if not known or not is_calm:
            return  # the list is unknown, not empty
        if sessions == self._listed_of and now_s < self._list_again_s:
            return
        self._listed_of, self._list_again_s = sessions, now_s + LIST_AGAIN_S
        listed = await self.network.ask(
            declared_key("publisher", f"{self._namespace}/**"), most_bytes=LIST_BYTES
        )
        if listed.left_out:
            self.system.say_cut("there are more publishers than can be kept; some are left out")
        found, misnamed = set(), set()
        async for key, sessions in in_slices(map(declaration_in, listed)):
            if sessions and is_stream(key, self._namespace):
                found.add(key)
            elif sessions and len(key) <= MAX_CHARACTERS:
                misnamed.add(misnamed_camera(key, self._namespace))
        self.system.set_misnamed(misnamed - {""})
        cut = listed.timed_out or bool(listed.left_out)
        self.system.set_published(found, complete=not cut)
        self._settle_soon()


def _of_their_nodes(replies: list[Reply], kind: type[M]) -> Iterator[M]:
    """Yield the messages of replies on the key of the node that they are about."""
    small = (each for each in replies if each.ok and len(each.ok.payload) <= MAX_DESCRIPTION_BYTES)
    return (found for reply, found in messages_in(small, kind) if found.node == reply.name)


def _reject(error: PayloadError) -> None:
    log.debug("%s", error)
