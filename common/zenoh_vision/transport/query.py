"""Zenoh queries: ask a key expression and collect the replies, with times sent and received.

``send`` returns at once and hands the replies to a callback; ``ask`` waits for them.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, wait
from dataclasses import dataclass
from typing import Any, TypeVar

import zenoh

from zenoh_vision.errors import ExpectationNotMet, ParameterRefused, PayloadError
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import Header, Refusal

log = logging.getLogger(__name__)

POLL_S = 0.05
REPLY_S = 1.0
"""How long a queryable may take to reply."""

LATE_S = 1.0
"""How long after its time-out a query may be reported as complete."""

MAX_REPLIES = 65_536
"""Limit of the replies to one query that are kept: twice those of 1000 nodes with 30 parameters."""

REPLY_BYTES = 1000
"""Bytes that a reply takes besides its payload."""

MAX_ERROR = 200
"""Characters of an error reply that are shown."""

M = TypeVar("M", bound=Message)


@dataclass(frozen=True, slots=True)
class Query:
    """A query for every queryable on a key expression, also for several on the same key.

    Attributes:
        key: Key expression, which may have wildcards.
        payload: msgpack bytes, if any.
        timeout_s: Replies that come later are lost.
        tokens: Ask for liveliness tokens instead of queryables.
        most_bytes: Limit of all replies together; those beyond it are left out, except the first.
    """

    key: str
    payload: bytes | None = None
    timeout_s: float = REPLY_S
    tokens: bool = False
    most_bytes: int = 256 << 20


@dataclass(frozen=True, slots=True)
class Reply:
    """One reply to a query.

    Attributes:
        ok: The sample of a good reply, else None.
        err: The error of an error reply, else None.
        session: Zenoh id of the session that replied; empty if it is unknown.
        sent_ns: When the query was sent, ns since 1970.
        received_ns: When the reply arrived, ns since 1970.
        own: Whether it is the asking session's own, about one of its tokens. Zenoh leaves such a
            reply out if the router has replied before.
    """

    ok: zenoh.Sample | None
    err: zenoh.ReplyError | None
    session: str
    sent_ns: int
    received_ns: int
    own: bool = False

    @property
    def key(self) -> str:
        """The key of a good reply; empty for an error."""
        return "" if self.ok is None else str(self.ok.key_expr)

    @property
    def name(self) -> str:
        """The last chunk of the key: the node's name in the keys of nodes."""
        return self.key.rpartition("/")[2]

    def message(self, kind: type[M]) -> M:
        """Decode the message in the reply.

        Raises:
            PayloadError: The payload is no such message.
            ParameterRefused: The reply refuses a change of parameters.
            ExpectationNotMet: The reply is another error; says which.
        """
        if self.ok is not None:
            return kind.from_bytes(self.ok.payload.to_bytes())
        assert self.err is not None
        payload = self.err.payload.to_bytes()
        try:
            refusal = Refusal.from_bytes(payload)
        except PayloadError:
            raise ExpectationNotMet(payload.decode(errors="replace")[:MAX_ERROR]) from None
        raise ParameterRefused(refusal.error, refusal.allowed)


class Replies(list[Reply]):
    """The replies to one query.

    Attributes:
        left_out: How many more there were than are kept.
        timed_out: The time was over before the router or some queryable had replied.
    """

    left_out = 0
    timed_out = False


def messages_in(replies: Iterable[Reply], kind: type[M]) -> Iterator[tuple[Reply, M]]:
    """Yield the good replies that hold a message of a type, each with it; skip all others."""
    for reply in replies:
        try:
            if reply.ok is not None:
                yield reply, reply.message(kind)
        except PayloadError:
            continue  # of a foreign program that uses the same key


def send(session: zenoh.Session, query: Query, done: Callable[[Replies], None]) -> None:
    """Send a query without waiting for replies.

    Args:
        session: The current session.
        query: The key expression to ask, and how long to wait.
        done: Called once, on Zenoh's thread, with all replies: when every queryable has replied
            or the time is over. Must be quick. Never called if the session is closed before. For
            tokens, Zenoh 1.10 calls it with the session locked: it must neither use the session nor
            wait for a thread that does.
    """
    replies = Replies()
    sent_ns = time.time_ns()
    asking = threading.get_ident()
    size = 0

    def receive(reply: zenoh.Reply) -> None:
        nonlocal size
        said = reply.ok or reply.err
        length = 0 if said is None else len(said.payload)
        if reply.err is not None and length < 10 and reply.err.payload.to_bytes() == b"Timeout":
            replies.timed_out = True  # Zenoh's own word for a reply that did not come in time
            return
        fits = size + REPLY_BYTES + length <= query.most_bytes
        if replies and (not fits or len(replies) >= MAX_REPLIES):
            replies.left_out += 1
            return
        if fits:  # a larger one leaves room for smaller ones after it
            size += REPLY_BYTES + length
        replier = "" if reply.replier_id is None else str(reply.replier_id.zid)
        # What the router replies comes on a thread of Zenoh's.
        own = query.tokens and threading.get_ident() == asking
        replies.append(Reply(reply.ok, reply.err, replier, sent_ns, time.time_ns(), own))

    handler: Any = zenoh.handlers.Callback(receive, lambda: done(replies), indirect=False)
    if query.tokens:
        session.liveliness().get(query.key, handler, timeout=query.timeout_s)
        return
    session.get(
        query.key,
        handler,
        payload=query.payload,
        encoding=None if query.payload is None else "application/msgpack",
        timeout=query.timeout_s,
        # Zenoh's defaults ask the nearest queryable and keep one reply for each key.
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
    )


def ask(
    session: zenoh.Session, queries: Iterable[Query], stopping: Callable[[], bool] = lambda: False
) -> list[Replies]:
    """Send queries together and wait for all replies, at most for the longest time-out of them.

    ``stopping`` ends the wait early; queries that are not complete then have no replies. Replies
    over a limit are left out, with a warning. An incomplete list of tokens is warned of too.
    """
    pending: list[Future[Replies]] = []
    asked = list(queries)
    for query in asked:
        pending.append(Future())
        send(session, query, pending[-1].set_result)
    # A session that is closed meanwhile never completes its queries.
    until_s = time.monotonic() + max((query.timeout_s for query in asked), default=0.0) + LATE_S
    while not stopping() and wait(pending, POLL_S).not_done and time.monotonic() < until_s:
        pass
    found = [future.result() if future.done() else Replies() for future in pending]
    for query, replies in zip(asked, found, strict=True):
        if replies.left_out:
            log.warning("%s: %d more replies are left out", query.key, replies.left_out)
        if query.tokens and replies.timed_out:
            log.warning(
                "%s: the router has not listed all tokens within %g s", query.key, query.timeout_s
            )
    return found


def newest(
    session: zenoh.Session,
    keys: Iterable[str],
    most_bytes: int,
    stopping: Callable[[], bool] = lambda: False,
    frame: Header | None = None,
) -> list[zenoh.Sample]:
    """Return what the streams on keys answer when they are asked for their newest, by key.

    The keys, without wildcards, are asked together, for at most ``REPLY_S``. Streams that have the
    ``frame`` still return it rather than their newest. Answers above ``most_bytes`` are left out.
    """
    named = "" if frame is None else f"?epoch={frame.epoch};seq={frame.seq}"
    found = ask(session, [Query(f"{key}{named}") for key in keys], stopping)
    return [
        reply.ok
        for replies in found
        for reply in replies
        if reply.ok is not None and len(reply.ok.payload) <= most_bytes
    ]
