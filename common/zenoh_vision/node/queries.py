"""The queries that a node answers: its schemas, its parameters, and topics without messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from zenoh_vision import keys
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import Diagnostics, Header, NodeDescription
from zenoh_vision.node import parameter_server
from zenoh_vision.node.outputs import Outputs
from zenoh_vision.node.parameter_server import ParameterServer
from zenoh_vision.node.query_server import QueryServer, message_answer, schema_answer
from zenoh_vision.topics import Topic, topic_named
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.link import Link


class Owner(Protocol):
    """The part of a node that its queries use."""

    name: str
    connection: Connection
    outputs: Outputs
    parameters: ParameterStore[Any] | None

    @property
    def link(self) -> Link:
        """Its link to the router."""


class Queries:
    """Answers queries for schemas, for parameters, and on the topics that a service answers.

    Args:
        node: Has the schemas and the parameters.
        camera: Returns the camera that an argument selects; ValueError if the node does not serve
            it.
    """

    def __init__(self, node: Owner, camera: Callable[[str | None], str]) -> None:
        self._node = node
        self._camera = camera
        self.server = QueryServer()

    def declare(self, link: Link) -> None:
        """Declare the schemas and the parameters; the server answers once it is started."""
        node, namespace = self._node, self._node.connection.namespace
        messages: set[type[Message]] = {Header, Diagnostics, NodeDescription}
        messages.update(topic.message for topic in node.outputs.topics if topic.message)
        if node.parameters is not None:
            parameters = ParameterServer(node.parameters, namespace, node.name)
            parameters.publish_changes(link)
            self.server.declare(link, parameters.key, parameters.answer)
            messages.update(parameter_server.MESSAGES)
        schemas = schema_answer(namespace, messages)
        self.server.declare(link, keys.schema_key(namespace, "*"), schemas)

    def answer(
        self,
        topic: Topic | str,
        reply_to: Callable[[Mapping[str, str]], Message],
        *,
        camera: str | None = None,
    ) -> None:
        """Answer the queries on a topic that is never published, until the node closes.

        Args:
            topic: One of those that the node publishes, with ``by_query``.
            reply_to: Called with the parameters of each query, one after the other, on the thread
                for queries. A ``ParameterRefused`` that it raises is sent as an error.
            camera: As for ``frames``.

        Raises:
            RuntimeError: The node is not open.
            ValueError: The table has no topic of this name, or it is published.
        """
        row = topic_named(topic)
        if not row.by_query:
            raise ValueError(f"{row.name} is published; queries get its newest message")
        key = row.key(self._node.connection.namespace, self._camera(camera))
        self.server.declare(self._node.link, key, message_answer(key, reply_to))
