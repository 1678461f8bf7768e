"""The queries that a node answers: its schemas, its parameters, and topics without messages."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from zenoh_vision import keys
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import Diagnostics, Header, NodeDescription
from zenoh_vision.node import parameter_server
from zenoh_vision.node.core import Core
from zenoh_vision.node.outputs import Outputs
from zenoh_vision.node.parameter_server import ParameterServer
from zenoh_vision.node.query_server import QueryServer, message_answer, schema_answer
from zenoh_vision.topics import Topic, topic_named


class Queries:
    """Answers queries for schemas, for parameters, and on the topics that a service answers."""

    def __init__(self, core: Core, outputs: Outputs) -> None:
        self._core = core
        self._outputs = outputs
        self.server = QueryServer(core.health.log_drop)

    def declare(self) -> Callable[[], None]:
        """Declare the schemas and the parameters; the server answers once it is started.

        Returns:
            Ends the publishing of changes; a camera's controls go when the session is closed.
        """
        core, namespace = self._core, self._core.namespace
        end: Callable[[], None] = _nothing
        if core.parameters is not None:
            parameters = ParameterServer(core.parameters, namespace, core.name, core.clock)
            end = parameters.publish_changes(core.link)
            for key in (parameters.key, parameters.set_key):
                self.server.declare(core.link, key, parameters.answer)
        schemas = schema_answer(namespace, self._messages)
        self.server.declare(core.link, keys.schema_key(namespace, "*"), schemas)
        return end

    def _messages(self) -> Iterable[type[Message]]:
        """Return the classes of all messages that the node sends now."""
        found: set[type[Message]] = {Header, Diagnostics, NodeDescription}
        found.update(topic.message for topic in self._outputs.topics if topic.message)
        if self._core.parameters is not None:
            found.update(parameter_server.MESSAGES)
        return found

    def answer(
        self,
        topic: Topic | str,
        reply_to: Callable[[Mapping[str, str]], Message],
        *,
        camera: str | None = None,
    ) -> None:
        """Answer the queries on a topic that is never published; see ``Node.answer``."""
        row = topic_named(topic)
        if not row.by_query:
            raise ValueError(f"{row.name} is published; queries get its newest message")
        key = row.key(self._core.namespace, self._core.camera(camera))
        self.server.declare(self._core.link, key, message_answer(key, reply_to))


def _nothing() -> None:
    """Do nothing: a node without parameters publishes no changes of them."""
