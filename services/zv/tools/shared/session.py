"""The Zenoh session of a tool, which has no token and no queryable, and ends on a signal."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Self

import zenoh

from zenoh_vision.errors import ConfigurationError, ExpectationNotMet
from zenoh_vision.host.signals import StopSignals
from zenoh_vision.security.rights import Action
from zenoh_vision.transport.access import declare_holder
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.query import POLL_S, REPLY_S, Query, Replies, ask
from zenoh_vision.transport.session import direct
from zenoh_vision.transport.zenoh_config import credentials_of, zenoh_error_text
from zv.tools.shared.output import discard_unread_output

log = logging.getLogger(__name__)
CONDITION_POLL_S = 0.02


class ToolSession:
    """A session that is open within the ``with`` block and whose waits end on SIGINT or SIGTERM.

    Attributes:
        clock: Returns monotonic seconds, by which tools measure.

    Raises:
        RouterUnreachable: On entering, if there is no router in time.
        ToldToStop: On entering, if told to stop before there was one.
    """

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.namespace = connection.namespace
        self.clock = time.monotonic
        self.stopping = False
        """Whether SIGINT or SIGTERM came, or ``stop()`` was called."""
        self._signals = StopSignals(self._on_signal)
        self.credentials = credentials_of(connection)
        """Whose certificate this is, if it has one."""
        self._warned: set[str] = set()

    def __enter__(self) -> Self:
        with ExitStack() as opening:
            opening.enter_context(self._signals)
            self.link = Link(self.connection, lambda: self.stopping, lambda: self.stopping)
            self._open = opening.pop_all()
        if self.credentials is not None:
            declare_holder(self.link, self.credentials)
        return self

    def __exit__(self, *error: object) -> None:
        """Close the session, in bounded time whatever the router does."""
        with self._open:
            self.link.close()

    @property
    def connected(self) -> bool:
        """Whether a router is connected."""
        return self.link.connected

    def _on_signal(self) -> None:
        self.stop()
        discard_unread_output()

    def stop(self) -> None:
        """End the waits; safe in a signal handler and from any thread."""
        self.stopping = True

    def wait(self, seconds: float, until: Callable[[], object] | None = None) -> bool:
        """Wait for a time, until a condition holds or until told to stop; False if told to stop."""
        end_s = time.monotonic() + seconds
        while not self.stopping and not (until and until()):
            left_s = end_s - time.monotonic()
            if left_s <= 0:
                break
            time.sleep(min(POLL_S if until is None else CONDITION_POLL_S, left_s))
        return not self.stopping

    def subscribe(
        self, key: str, on_sample: Callable[[zenoh.Sample], None]
    ) -> Declaration[zenoh.Subscriber[None]]:
        """Subscribe; the callback runs on Zenoh's thread and must be quick.

        The subscription ends with the session, or when the returned object is undeclared.

        Raises:
            ExpectationNotMet: The credentials do not allow it.
        """
        self.require("subscribe", key)
        return self.link.declare(lambda session: session.declare_subscriber(key, direct(on_sample)))

    def require(self, action: Action, key: str) -> None:
        """Check that the credentials, if there are some, allow an action; Zenoh would be silent.

        Raises:
            ExpectationNotMet: They do not; says what they allow.
        """
        if (denial := self.denial(action, key)) is not None:
            raise ExpectationNotMet(denial)

    def _warn_denied(self, action: Action, key: str) -> None:
        denial = self.denial(action, key)
        if denial is not None and denial not in self._warned:
            self._warned.add(denial)
            log.warning("%s; so nothing is known of it", denial)

    def denial(self, action: Action, key: str) -> str | None:
        """Return that the credentials do not allow an action; None if they do, or without any."""
        known = self.credentials
        if known is None or known.rights.granting(action, key) is not None:
            return None
        check = f"zv security check {known.name} {key} {action} --dir {known.path.parent}"
        return f"{known.name} may not {action} {key}: {check}"

    def ask(self, key: str, payload: bytes | None = None, *, timeout_s: float = REPLY_S) -> Replies:
        """Return all replies to a query, errors included; see ``Query`` for the arguments."""
        return self.ask_all(Query(key, payload, timeout_s))[0]

    def ask_all(self, *queries: Query) -> list[Replies]:
        """Send queries together and return the replies to each; none when told to stop.

        Raises:
            ExpectationNotMet: The credentials do not allow one that has a payload.
        """
        for query in queries:
            if query.payload is not None:
                self.require("query", query.key)
            elif not query.tokens:
                self._warn_denied("query", query.key)
        return ask(self.link.session, queries, lambda: self.stopping)


def key_expression(text: str) -> str:
    """Return the canonical form of a key expression, without the leading slash of ROS topics.

    Raises:
        ConfigurationError: The text is not a key expression.
    """
    try:
        return str(zenoh.KeyExpr.autocanonize(text.removeprefix("/")))
    except zenoh.ZError as error:
        raise ConfigurationError(
            f"{text!r} is not a key expression ({zenoh_error_text(error)}); "
            "allowed are chunks between single slashes, * for one chunk, ** for any number"
        ) from None
