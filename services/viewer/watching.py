"""Listens to tokens, health and parameters, and asks who is new."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping
from functools import partial
from typing import Any

import msgpack
import zenoh

from common import keys
from common.errors import ParameterRefused, PayloadError
from common.link import Link
from common.messages import Diagnostics, NodeDescription, Parameter, ParameterList, Refusal
from common.session import direct
from services.viewer.network import Mailbox, Network
from services.viewer.system import System

log = logging.getLogger("viewer")

TICK_S = 0.5
TELL_EVERY = 4
"""Ticks: so often pages hear that the connection is there."""

DESCRIBE_EVERY = 10
"""Ticks: descriptions are asked for anew, since a node's subscriptions change."""

MAX_BYTES = 256 << 10
ANSWER_S = 1.5


class Unanswered(Exception):
    """A node did not answer."""


class Watcher:
    """Keeps a ``System`` true.

    Args:
        system: What is kept.
        network: Where it is asked.

    Attributes:
        pages: How many pages are open.
    """

    def __init__(self, system: System, network: Network) -> None:
        self.system = system
        self.network = network
        self.pages = 0
        self._namespace = system.namespace
        self._box = Mailbox[tuple[str, str], bytes | None](network.loop, self._take)
        self._reports: dict[str, type[Diagnostics | Parameter]] = {
            "health": Diagnostics,
            "parameter": Parameter,
        }
        self._asking: set[asyncio.Task[None]] = set()

    def begin(self) -> None:
        """Listen: there is a session now."""
        self.network.do(self._declare)

    async def run(self) -> None:
        """Look after the router and the nodes for ever."""
        turn = 0
        while True:
            self.network.do(self._look_for_router)
            turn += 1
            described = not self.system.undescribed()
            if turn % (DESCRIBE_EVERY if described else 2) == 0 and (self.pages or not described):
                self._ask("*")
            if turn % TELL_EVERY == 0:
                self.system.tick()
            self.system.forget()
            await asyncio.sleep(TICK_S)

    async def set(self, node: str, values: Mapping[str, object]) -> ParameterList:
        """Change parameters of a node, all or none, and return what holds then.

        Raises:
            ParameterRefused: It refuses.
            Unanswered: It does not answer.
        """
        try:
            payload = msgpack.packb(dict(values))
        except (TypeError, ValueError, OverflowError):
            raise ParameterRefused(
                "a value that is none of a parameter", "a number, a text, true, false or null"
            ) from None
        return await self._parameters(node, payload)

    async def parameters(self, node: str) -> ParameterList:
        """Return the parameters of a node.

        Raises:
            Unanswered: It does not answer.
            ParameterRefused: It refuses.
        """
        return await self._parameters(node, None)

    async def _parameters(self, node: str, payload: bytes | None) -> ParameterList:
        key = keys.parameters_key(self._namespace, node)
        for reply in await self.network.ask(key, payload=payload, timeout_s=ANSWER_S):
            if reply.ok is not None:
                try:
                    return ParameterList.from_bytes(reply.ok.payload.to_bytes())
                except PayloadError as error:
                    raise Unanswered(f"{node} answers with {error}") from None
            assert reply.err is not None
            said = reply.err.payload.to_bytes()
            try:
                refusal = Refusal.from_bytes(said)
            except PayloadError:
                raise Unanswered(f"{node}: {said[:200].decode(errors='replace')}") from None
            raise ParameterRefused(refusal.error, refusal.allowed)
        raise Unanswered(f"{node} does not answer")

    # On the network's and Zenoh's threads

    def _declare(self, link: Link) -> None:
        tokens = keys.node_key(self._namespace, "*")
        on_token = direct(partial(self._on_sample, "token"))
        link.declare(
            lambda session: session.liveliness().declare_subscriber(tokens, on_token, history=True)
        )
        for kind, key in (
            ("health", keys.diagnostics_key(self._namespace, "*")),
            ("parameter", keys.parameter_key(self._namespace, "*", "*")),
        ):
            handler = direct(partial(self._on_sample, kind))
            link.declare(partial(_subscribe, key, handler))

    def _on_sample(self, kind: str, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        if sample.kind != zenoh.SampleKind.PUT:
            self._box.put((kind, key), None)
        elif len(sample.payload) <= MAX_BYTES:
            self._box.put((kind, key), sample.payload.to_bytes())

    def _look_for_router(self, link: Link) -> None:
        connected = link.connected
        if connected != self.system.connected:
            self._box.put(("router", ""), b"1" if connected else None)

    # On the loop

    def _take(self, what: tuple[str, str], payload: bytes | None) -> None:
        kind, key = what
        name = key.split("/")[2] if key else ""
        if kind == "router":
            self.system.router(payload is not None)
            if payload is not None:
                self._ask("*")
        elif kind == "token":
            if self.system.token(name, payload is not None) and payload is not None:
                self._ask(name)
        elif payload is not None:
            try:
                report = self._reports[kind].from_bytes(payload)
                if report.node != name:
                    raise PayloadError("wrong_node", f"of {report.node!r}")
                if isinstance(report, Diagnostics):
                    self.system.health(report)
                else:
                    self.system.parameter(report)
            except PayloadError as error:
                log.debug("%s: %s", key, error)

    def _ask(self, node: str) -> None:
        task = self.network.loop.create_task(self._learn(node))
        self._asking.add(task)
        task.add_done_callback(self._asking.discard)

    async def _learn(self, node: str) -> None:
        """Ask a node, or all, who it is and for its parameters."""
        described, listed = await asyncio.gather(
            self.network.ask(keys.node_key(self._namespace, node)),
            self.network.ask(keys.parameters_key(self._namespace, node)),
        )
        for reply in described:
            if reply.ok is not None:
                try:
                    payload = reply.ok.payload.to_bytes()
                    self.system.describe(NodeDescription.from_bytes(payload))
                except PayloadError as error:
                    log.debug("%s: %s", reply.ok.key_expr, error)
        for reply in listed:
            if reply.ok is not None:
                try:
                    found = ParameterList.from_bytes(reply.ok.payload.to_bytes())
                except PayloadError as error:
                    log.debug("%s: %s", reply.ok.key_expr, error)
                    continue
                self.system.parameters(found.node, list(found.parameters))


def _subscribe(key: str, handler: Any, session: zenoh.Session) -> zenoh.Subscriber[None]:
    return session.declare_subscriber(key, handler)
