"""What a node tells of itself on the network: its token, its description, its health."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import zenoh

from common import keys
from common.description import description
from common.health import Health
from common.heartbeat import Heartbeat
from common.link import Link
from common.messages import Diagnostics, NodeDescription
from common.publishing import Sample, StreamPublisher
from common.serving import QueryServer


class SelfReport:
    """The token, the answer to who it is, and the diagnostics once a second.

    Args:
        node: Its name.
        service: What kind it is.
        cameras: Those it serves.
        health: How it does; it knows the keys of the frames that come in.
        publishes: Returns the keys that it publishes.
        listens: Returns the keys that it subscribes to besides those of its frames.
    """

    def __init__(
        self,
        node: str,
        service: str,
        cameras: Sequence[str],
        health: Health,
        *,
        publishes: Callable[[], Sequence[str]],
        listens: Callable[[], Sequence[str]],
    ) -> None:
        self._node = node
        self._service = service
        self._cameras = cameras
        self._health = health
        self._publishes = publishes
        self._listens = listens
        self._started_ns = time.time_ns()
        self._heartbeat = Heartbeat()

    def waiting(self) -> None:
        """Say that it waits for a router, which is to be well."""
        self._heartbeat.beat()

    def declare(self, link: Link, namespace: str, server: QueryServer) -> None:
        """Declare what answers and what is sent; ``show`` comes when all else is there."""
        self._link = link
        self._key = keys.node_key(namespace, self._node)
        self._diagnostics = StreamPublisher(
            link,
            keys.message_topic("diagnostics", Diagnostics.schema_name),
            keys.diagnostics_key(namespace, self._node),
            server.ask,
        )
        server.declare(link, self._key, self._describe)

    def show(self) -> None:
        """Show the token: whoever sees it may ask for all that the node offers."""
        self._link.declare(lambda session: session.liveliness().declare_token(self._key))

    def send(self) -> None:
        """Send the diagnostics, and say in the heartbeat's file how it does."""
        self._heartbeat.beat(self._health.trouble())
        diagnostics = self._health.diagnostics()
        self._diagnostics.offer(
            lambda: Sample(diagnostics.to_bytes(), self._diagnostics.topic.encoding, None)
        )

    def _describe(self, query: zenoh.Query) -> None:
        own = description(
            self._node,
            self._service,
            self._cameras,
            started_ns=self._started_ns,
            publishes=self._publishes(),
            subscribes=[*(receiver.key for receiver in self._health.receivers), *self._listens()],
            rate_hz=self._health.bounds.expected_hz,
        )
        query.reply(
            self._key, own.to_bytes(), encoding=keys.msgpack_of(NodeDescription.schema_name)
        )
