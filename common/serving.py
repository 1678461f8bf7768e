"""The thread of a node that answers queries and publishes its health once a second."""

from __future__ import annotations

import json
import logging
import queue
import threading
import time
from collections.abc import Callable
from functools import partial

import zenoh

from common import keys
from common.codec import Message
from common.link import Link
from common.messages import Header
from common.session import direct

log = logging.getLogger(__name__)

HEALTH_PERIOD_S = 1.0
MAX_WAITING_QUERIES = 256

Answer = Callable[[zenoh.Query], None]


class QueryServer:
    """Answers queries one after the other, off Zenoh's thread; ticks once a second.

    Args:
        tick: Called every ``HEALTH_PERIOD_S``, and once more when closing.
    """

    def __init__(self, tick: Callable[[], None]) -> None:
        self._tick = tick
        self._waiting: queue.Queue[tuple[zenoh.Query, Answer] | None] = queue.Queue(
            MAX_WAITING_QUERIES
        )
        self._thread = threading.Thread(target=self._serve, name="queries and health", daemon=True)

    def start(self) -> None:
        """Begin to answer and to tick."""
        self._thread.start()

    def ask(self, query: zenoh.Query, answer: Answer) -> None:
        """Queue a query; refuse it if too many wait. Never blocks."""
        try:
            self._waiting.put_nowait((query, answer))
        except queue.Full:
            with query:
                query.reply_err(b"busy: too many queries are waiting", encoding="text/plain")

    def declare(self, link: Link, key: str, answer: Answer) -> None:
        """Answer queries on a key."""
        handler = direct(lambda query: self.ask(query, answer))
        link.declare(lambda session: session.declare_queryable(key, handler))

    def close(self) -> None:
        """Finish the query in work, tick once more, end the thread."""
        if self._thread.is_alive():
            self._waiting.put(None)
            self._thread.join(timeout=1.0)

    def _serve(self) -> None:
        due = time.monotonic() + HEALTH_PERIOD_S
        while True:
            # Asked before the queue is: however many queries wait, the tick must not.
            if time.monotonic() >= due:
                self._guarded(self._tick)
                due = max(due + HEALTH_PERIOD_S, time.monotonic())
            try:
                item = self._waiting.get(timeout=max(0.0, due - time.monotonic()))
            except queue.Empty:
                continue
            if item is None:
                self._guarded(self._tick)
                return
            query, answer = item
            with query:  # a query that is not dropped keeps its asker waiting
                self._guarded(partial(answer, query))

    @staticmethod
    def _guarded(work: Callable[[], None]) -> None:
        """Let no query and no health report end the thread."""
        try:
            work()
        except Exception:
            log.exception("a query could not be answered")


def answer_schemas(namespace: str, messages: set[type[Message]]) -> Answer:
    """Return what answers ``@{ns}/schema/{name}`` with the JSON Schema of the messages sent.

    A message is found under its class name (``Centroid``) and its versioned one
    (``vision.Centroid.v1``).
    """
    named: dict[str, type[Message]] = {}
    sent: set[type[Message]] = {Header, *messages}
    for message in sent:
        named[keys.schema_key(namespace, message.schema_name)] = message
        named[keys.schema_key(namespace, message.schema_name.split(".")[-2])] = message

    def answer(query: zenoh.Query) -> None:
        for key, message in named.items():
            if query.key_expr.intersects(zenoh.KeyExpr(key)):
                text = json.dumps(message.model_json_schema())
                query.reply(key, text, encoding=keys.JSON)

    return answer
