"""A tool's session: a guest at the router, without token or queryable, ended by a signal."""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

import zenoh

from common.connection import Connection
from common.errors import ConfigurationError
from common.link import Declaration, Link
from common.session import direct
from common.signals import StopSignals
from common.zenoh_config import plain
from services.tools.asking import EVERY_ANSWER, POLL_S, Answer, Question, answers_to

CONDITION_POLL_S = 0.02
ANSWER_S = 1.0
"""How long a node may take to answer a query."""

ROUTERS = "@/*/router"
"""Where a router answers for itself, if it lets one look."""


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
            self.link = Link(self.connection, lambda: self._stopping, lambda: self._stopping)
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
        self.link.close()
        self._signals.release()

    @property
    def stopping(self) -> bool:
        """Whether SIGINT or SIGTERM came, or ``stop()`` was called."""
        return self._stopping

    @property
    def connected(self) -> bool:
        """Whether a router is there at the moment."""
        return self.link.connected

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
    ) -> Declaration[zenoh.Subscriber[None]]:
        """Subscribe; the callback runs on Zenoh's thread and must be quick.

        The subscription ends with the session, or when what this returns is undeclared.
        """
        return self.link.declare(lambda session: session.declare_subscriber(key, direct(on_sample)))

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
        how = {**EVERY_ANSWER, "payload": payload, **options}

        def question(handler: Any) -> object:
            return self.link.session.get(key, handler, timeout=timeout_s, **how)

        (answers,) = answers_to([question], lambda: self._stopping)
        return [answer.reply for answer in answers]

    def gather(self, *questions: Question) -> list[list[Answer]]:
        """Ask several questions at once and return the good answers to each."""
        found = answers_to(questions, lambda: self._stopping)
        return [[answer for answer in answers if answer.reply.ok] for answers in found]


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
