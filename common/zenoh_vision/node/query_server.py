"""Answers a node's queries one after the other, on a thread of its own."""

from __future__ import annotations

import json
import logging
import queue
import threading
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import cache
from typing import Any

import zenoh

from zenoh_vision import keys
from zenoh_vision.errors import ParameterRefused, PayloadError
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import Refusal, Stamped
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.session import direct

log = logging.getLogger(__name__)

MAX_WAITING_QUERIES = 256
MAX_WAITING_BYTES = 16 << 20
"""Payloads of the queries that wait: each may have the size of the largest frame."""

CLOSE_S = 1.0

Answer = Callable[[zenoh.Query], None]
"""Answers a query. A ``ParameterRefused`` becomes an error reply, the message ``Refusal``."""


class QueryServer:
    """A bounded queue of queries and the thread that answers them.

    Args:
        report: Called with what is wrong with an answer that cannot be made.
    """

    def __init__(self, report: Callable[[PayloadError], None] = lambda _: None) -> None:
        self._report = report
        self._waiting: queue.Queue[tuple[zenoh.Query, Answer, int] | None] = queue.Queue(
            MAX_WAITING_QUERIES
        )
        self._bytes = 0  # of the queries that wait and of the one in work
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="queries", daemon=True)

    def start(self) -> None:
        """Begin to answer."""
        self._thread.start()

    def queue(self, query: zenoh.Query, answer: Answer) -> None:
        """Queue a query; refuse it if too many, or too many bytes, wait. Never blocks."""
        size = 0 if query.payload is None else len(query.payload)
        with self._lock:
            fits = self._bytes + size <= MAX_WAITING_BYTES
            self._bytes += size if fits else 0
        try:
            if not fits:
                raise queue.Full
            self._waiting.put_nowait((query, answer, size))
        except queue.Full:
            self._forget(size if fits else 0)
            with query:
                query.reply_err(b"busy: too many queries are waiting", encoding="text/plain")

    def _forget(self, size: int) -> None:
        with self._lock:
            self._bytes -= size

    def declare(self, link: Link, key: str, answer: Answer) -> None:
        """Answer queries on a key."""
        handler = direct(lambda query: self.queue(query, answer))
        link.declare(lambda session: session.declare_queryable(key, handler))

    def close(self) -> None:
        """Finish the current query and end the thread, in bounded time."""
        self._closing.set()
        with suppress(queue.Full):  # then the thread checks `_closing` after this query
            self._waiting.put_nowait(None)
        if self._thread.is_alive():
            self._thread.join(CLOSE_S)

    def _serve(self) -> None:
        while (item := self._waiting.get()) is not None and not self._closing.is_set():
            query, answer, size = item
            with query:  # the sender waits until the query is dropped
                try:
                    _answer_or_refuse(query, answer)
                except Exception as error:  # of a function of the service, perhaps
                    log.debug("a query could not be answered", exc_info=True)
                    words = f"{type(error).__name__}: {error}"
                    self._report(PayloadError("not_answered", words))
                    with suppress(zenoh.ZError):  # it was answered before the error
                        query.reply_err(words.encode(errors="replace"), encoding="text/plain")
            self._forget(size)


def _answer_or_refuse(query: zenoh.Query, answer: Answer) -> None:
    try:
        answer(query)
    except ParameterRefused as refused:
        refusal = Refusal(error=refused.error, allowed=refused.allowed)
        encoding = keys.msgpack_of(Refusal.schema_name)
        query.reply_err(refusal.to_bytes(), encoding=encoding)


def _parameters(query: zenoh.Query) -> dict[str, str]:
    pairs: Any = query.parameters  # the binding's types do not know that it can be iterated
    return dict(pairs)


def message_answer(key: str, reply_to: Callable[[Mapping[str, str]], Message]) -> Answer:
    """Return a function that answers queries on a key with a message made for their parameters.

    A query with wildcards, such as a snapshot of all streams, gets no reply.
    """

    def answer(query: zenoh.Query) -> None:
        if str(query.key_expr) != key:
            return
        message = reply_to(_parameters(query))
        attachment = message.header.to_bytes() if isinstance(message, Stamped) else None
        encoding = keys.msgpack_of(message.schema_name)
        query.reply(key, message.to_bytes(), encoding=encoding, attachment=attachment)

    return answer


def schema_answer(namespace: str, messages: Callable[[], Iterable[type[Message]]]) -> Answer:
    """Return a function that answers ``@{ns}/schema/{name}`` with JSON Schemas of messages.

    The name is that of the class (``Centroid``) or the versioned one (``vision.Centroid.v1``).

    Args:
        namespace: First chunk of the keys.
        messages: Returns the classes of the messages at this moment.
    """

    @cache  # made when first asked for, and once: a flood of queries must not slow the node
    def text(message: type[Message]) -> str:
        return json.dumps(message.model_json_schema())

    def answer(query: zenoh.Query) -> None:
        for message in messages():
            for name in (message.schema_name, message.short_name()):
                key = zenoh.KeyExpr(keys.schema_key(namespace, name))
                if query.key_expr.intersects(key):
                    query.reply(key, text(message), encoding=keys.JSON)

    return answer
