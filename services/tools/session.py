"""A tool's session: a guest at the router, without token or queryable, ended by a signal."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any, Self

import zenoh

from common.connection import Connection
from common.errors import ConfigurationError
from common.session import close_session, direct, open_session
from common.signals import StopSignals
from common.zenoh_config import plain

POLL_S = 0.05
CONDITION_POLL_S = 0.02
ANSWER_S = 1.0
"""How long a node may take to answer a query."""


class ToolSession:
    """A session that is open inside the ``with`` and ends its waits when told to stop.

    Args:
        connection: Where the router is, and how long to wait for it.

    Raises:
        RouterUnreachable: On entering: no router in time.
        ToldToStop: On entering: told to stop before there was one.
    """

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.namespace = connection.namespace
        self._stopping = False
        self._signals = StopSignals(self.stop)

    def __enter__(self) -> Self:
        self._signals.catch()
        try:
            self.zenoh = open_session(self.connection, lambda: self._stopping)
        except BaseException:
            self._signals.release()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the session, in bounded time whatever the router does."""
        close_session(self.zenoh)
        self._signals.release()

    @property
    def stopping(self) -> bool:
        """Whether SIGINT or SIGTERM came, or ``stop()`` was called."""
        return self._stopping

    @property
    def connected(self) -> bool:
        """Whether a router is there at the moment."""
        return bool(list(self.zenoh.info.routers_zid()))

    def stop(self) -> None:
        """End the waits; safe in a signal handler and from any thread."""
        self._stopping = True

    def wait(self, seconds: float, until: Callable[[], object] | None = None) -> bool:
        """Wait so long, or until a condition holds, or until told to stop.

        Returns:
            Whether to go on: False when told to stop.
        """
        end_s = time.monotonic() + seconds
        while not self._stopping and not (until and until()):
            left_s = end_s - time.monotonic()
            if left_s <= 0:
                break
            time.sleep(min(POLL_S if until is None else CONDITION_POLL_S, left_s))
        return not self._stopping

    def subscribe(
        self, key: str, on_sample: Callable[[zenoh.Sample], None]
    ) -> zenoh.Subscriber[None]:
        """Subscribe; the callback runs on Zenoh's thread and must be quick.

        The subscription ends with the session, or when what this returns is undeclared.
        """
        return self.zenoh.declare_subscriber(key, direct(on_sample))

    def ask(
        self, key: str, payload: bytes | None = None, *, timeout_s: float = ANSWER_S, **options: Any
    ) -> list[zenoh.Reply]:
        """Return all replies to a query, good ones and refusals; empty if nobody answers.

        Args:
            key: Key expression, may have wildcards and a selector's parameters.
            payload: Of the query.
            timeout_s: Until then, whoever has not answered is left out.
            options: Of ``zenoh.Session.get``.
        """
        return self._answers([self._begin(key, timeout_s, payload=payload, **options)])[0]

    def ask_all(
        self, keys: Sequence[str], *, timeout_s: float = ANSWER_S
    ) -> list[list[zenoh.Reply]]:
        """Return the replies to several queries that are asked at once, in their order."""
        return self._answers([self._begin(key, timeout_s) for key in keys])

    def _begin(
        self, key: str, timeout_s: float, **options: Any
    ) -> tuple[list[zenoh.Reply], threading.Event]:
        # By default Zenoh asks the nearest of several who answer on one key, and no other.
        every = {
            "target": zenoh.QueryTarget.ALL,
            "consolidation": zenoh.ConsolidationMode.NONE,
        }
        replies: list[zenoh.Reply] = []
        done = threading.Event()
        handler: Any = zenoh.handlers.Callback(replies.append, done.set, indirect=False)
        self.zenoh.get(key, handler, timeout=timeout_s, **(every | options))
        return replies, done

    def _answers(
        self, asked: Sequence[tuple[list[zenoh.Reply], threading.Event]]
    ) -> list[list[zenoh.Reply]]:
        for _, done in asked:
            while not self._stopping and not done.wait(POLL_S):
                pass
        return [[reply for reply in list(found) if not _is_timeout(reply)] for found, _ in asked]


def _is_timeout(reply: zenoh.Reply) -> bool:
    """Tell Zenoh's own word that someone did not answer from a node's refusal."""
    return reply.err is not None and reply.err.payload.to_bytes() == b"Timeout"


def key_expression(text: str) -> str:
    """Return a key expression as Zenoh writes it; a leading slash, as ROS has it, is left out.

    Raises:
        ConfigurationError: It is none.
    """
    try:
        return str(zenoh.KeyExpr.autocanonize(text.removeprefix("/")))
    except zenoh.ZError as error:
        raise ConfigurationError(
            f"{text!r} is no key expression ({plain(error)}); "
            "allowed are chunks between single slashes, * for one chunk, ** for any number"
        ) from None
