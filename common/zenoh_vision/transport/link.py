"""A node's link to its router: a session and what is declared on it, replaced when it is cut off.

Zenoh reconnects a session by itself, with the time-outs that the session was opened with. When
those have become too short, because the link got slower, only another session can connect.

A session that reconnects before the router has forgotten its former connection may stay without an
answer: Zenoh 1.10's router then knows the connection, but nothing that is declared on it, for 10 s
or for good. So the router is asked for something every few seconds.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from contextlib import suppress
from typing import Any, Generic, TypeVar

import zenoh

from zenoh_vision import keys
from zenoh_vision.errors import ConnectionFault, RouterUnreachable, VisionError
from zenoh_vision.host.abandoned_threads import abandon
from zenoh_vision.security.credentials import file_state, without_clock
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.declarations import Kind
from zenoh_vision.transport.handshake import RefusalProbe
from zenoh_vision.transport.query import POLL_S, Query, Replies, send
from zenoh_vision.transport.session import (
    close_session,
    open_session,
    try_session,
    why_refused,
)
from zenoh_vision.transport.zenoh_config import credentials_of, where, zenoh_error_text

log = logging.getLogger(__name__)

REPLACE_AFTER_S = 10.0
"""After this long without a router, another session is tried: a usable one reconnects in 1 s."""

ASK_INTERVAL_S = 5.0
ANSWER_S = 2.0
"""A router that twice answers nothing for this long does not know what the session declared."""

FOLLOW_INTERVAL_S = 3.0
"""How often changed credentials are looked for. A session keeps those that it was opened with, also
when it reconnects: who was revoked, and given another certificate, would stay without any right."""

CHECK_INTERVAL_S = 0.5
GRACE_S = 0.5
"""Other threads may still use the old session for this long after it was replaced."""

CLOSE_TIMEOUT_S = 1.0

TELL_AFTER_S = 1.0
"""A shorter wait for the router is not logged: it is usual when a whole system starts."""

PROBE_AFTER_S = 0.4
"""When to find out why there is no connection: most are there by then."""

T = TypeVar(
    "T",
    bound="zenoh.Publisher | zenoh.Subscriber[Any] | zenoh.Queryable[Any] | zenoh.LivelinessToken",
)


class Declaration(Generic[T]):
    """Something declared on a link, across sessions.

    Attributes:
        current: The object declared on the current session. Do not keep a reference to it.
    """

    def __init__(
        self, link: Link, declare: Callable[[zenoh.Session], T], used: Callable[[], None]
    ) -> None:
        self._link = link
        self._used = used
        self.declare = declare
        self.use(declare(link.session))

    def use(self, declared: T) -> None:
        """Use what was declared last, on the session that is the current one from now on."""
        self.current = declared
        self._used()

    def undeclare(self) -> None:
        """Undeclare it, on this session and on those that replace it."""
        self._link.undeclare(self)


class Link:
    """A session that is replaced by another one when the router is not reached, or does not answer.

    Args:
        connection: Where the router is, and how long to wait for it here.
        give_up: Polled while this waits for the router; True ends the wait.
        stopping: Whether the program is about to end, so that no other session is tried.
        log_state: Log when this waits for the router, is connected, loses it, and has it back.
        refused: Called with why the router refuses the connection, and with an empty text when it
            does no more; on any thread.

    Raises:
        VisionError: As for ``open_session``.
    """

    def __init__(
        self,
        connection: Connection,
        give_up: Callable[[], bool] = lambda: False,
        stopping: Callable[[], bool] = lambda: False,
        *,
        log_state: bool = True,
        refused: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._connection = connection
        self._probe = RefusalProbe(self._why_refused)
        self._refused = ""
        self._tell_refused = refused
        self._stopping = stopping
        self._log_state = log_state
        self._where = where(connection)
        self._credentials = self._credentials_state()
        self._opened = False
        self._session = self._open(give_up)
        self._opened = True
        self._declared: list[Declaration[Any]] = []
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._asked_s = self._connected_s = self._followed_s = time.monotonic()
        self._lost_s: float | None = None
        self._thread = threading.Thread(target=self._monitor, name="link", daemon=True)
        self._thread.start()

    @property
    def session(self) -> zenoh.Session:
        """The current session, for puts and queries. What is declared on it ends with it."""
        return self._session

    @property
    def connected(self) -> bool:
        """Whether the session is connected to a router, or to a peer if a file configures one."""
        return bool(self.routers())

    def routers(self) -> frozenset[str]:
        """Return the ids of the routers, or peers, to which the session is connected now."""
        info = self._session.info
        try:
            both = (*info.routers_zid(), *info.peers_zid())
            return frozenset(map(str, both))
        except zenoh.ZError:
            return frozenset()  # the session is being closed

    def declare(
        self, declare: Callable[[zenoh.Session], T], used: Callable[[], None] = lambda: None
    ) -> Declaration[T]:
        """Declare something on this session, and on each that replaces it.

        Args:
            declare: Called once for every session, on any thread.
            used: Called when what was declared last is used: not if its session turns out to be of
                no use. Must not fail.
        """
        with self._lock:
            declaration = Declaration(self, declare, used)
            self._declared.append(declaration)
        return declaration

    def declared(self) -> set[tuple[Kind, str]]:
        """Return what is subscribed to and answered now, by the kinds of the routers' lists."""
        with self._lock:
            current = [each.current for each in self._declared]
        found: set[tuple[Kind, str]] = set()
        for each in current:
            if isinstance(each, zenoh.Queryable):
                found.add(("queryable", str(each.key_expr)))
            elif isinstance(each, zenoh.Subscriber):
                found.add(("subscriber", str(each.key_expr)))
        return found

    def undeclare(self, declaration: Declaration[Any]) -> None:
        """Undeclare something, if that was not done yet."""
        with self._lock:
            if declaration not in self._declared:
                return
            self._declared.remove(declaration)
        declaration.current.undeclare()

    def close(self) -> None:
        """Close the session in bounded time, whatever the router does."""
        self._closed.set()
        # No attempt may begin while the interpreter ends: Zenoh would abort the process.
        self._thread.join(CLOSE_TIMEOUT_S)
        abandon(self._thread)
        close_session(self._session)

    def _open(self, give_up: Callable[[], bool]) -> zenoh.Session:
        """Open the first session; log a long wait for the router, and its end."""
        began_s = time.monotonic()
        # Tools with a time limit report only its end.
        level = logging.WARNING if self._connection.timeout_s is None else logging.INFO
        told = False

        def waiting() -> bool:
            nonlocal told
            if not told and time.monotonic() - began_s > TELL_AFTER_S:
                told = True
                self._tell(level, "waiting for the router at %s", self._where)
            if time.monotonic() - began_s > PROBE_AFTER_S:
                self._follow_refusal()
            return give_up()

        try:
            session = open_session(self._connection, waiting, lambda: bool(self._refused))
        except RouterUnreachable:
            if not self._refused:
                raise
            within = f"no connection to a router within {self._connection.timeout_s:g} s"
            raise ConnectionFault(f"{within}: {self._refused}") from None
        self._note_refusal("")
        if told:
            took_s = time.monotonic() - began_s
            self._tell(level, "connected to the router at %s after %.1f s", self._where, took_s)
        else:
            self._tell(logging.INFO, "connected to the router at %s", self._where)
        return session

    def _why_refused(self) -> str:
        try:
            return why_refused(self._connection)
        except VisionError as error:
            return str(error)  # of credentials that were changed meanwhile

    def _follow_refusal(self) -> None:
        """Find out, without waiting, whether the router refuses the connection, and why."""
        self._probe.begin()
        self._note_refusal(self._probe.text)

    def _note_refusal(self, text: str) -> None:
        if not text:
            self._probe.text = ""
        if without_clock(text) == without_clock(self._refused):
            return
        self._refused = text
        # A tool that was never connected ends with this text.
        ends_with_it = self._connection.timeout_s is not None and not self._opened
        if text and self._log_state and not ends_with_it:
            log.error("%s", text)
        self._tell_refused(text)

    def _tell(self, level: int, text: str, *values: object) -> None:
        if self._log_state:
            log.log(level, text, *values)

    def _ending(self) -> bool:
        return self._closed.is_set() or self._stopping()

    def _monitor(self) -> None:
        while not self._closed.wait(CHECK_INTERVAL_S):
            try:
                self._check()
            except Exception:
                if self._ending():
                    return  # the session was closed meanwhile
                log.exception("checking the session, or opening another one, failed")
                self._asked_s = self._connected_s = time.monotonic()

    def _check(self) -> None:
        """Log that the router was lost or is back; replace the session where that is due."""
        connected, now_s = self.connected, time.monotonic()
        if self._ending():
            return
        if not connected:
            if self._lost_s is None:
                self._lost_s = now_s
                text = "lost the router at %s; trying to reach it again until it is back"
                self._tell(logging.WARNING, text, self._where)
            self._follow_refusal()
            if now_s - self._connected_s > REPLACE_AFTER_S:
                self._try_replacement(f"no router for {REPLACE_AFTER_S:g} s")
                self._connected_s = time.monotonic()
            return
        self._connected_s, lost_s, self._lost_s = now_s, self._lost_s, None
        self._note_refusal("")
        if lost_s is not None:
            text = "the router at %s is back after %.1f s"
            self._tell(logging.WARNING, text, self._where, now_s - lost_s)
        if now_s - self._followed_s > FOLLOW_INTERVAL_S:
            self._follow_credentials()
            self._followed_s = time.monotonic()
        if lost_s is not None or now_s - self._asked_s > ASK_INTERVAL_S:
            if not self._is_answered() and not self._is_answered():
                self._try_replacement("the router does not answer", is_connected=True)
            self._asked_s = time.monotonic()

    def _credentials_state(self) -> tuple[int, ...] | None:
        """Return what changes when the credentials do; None without any that can be used."""
        try:
            known = credentials_of(self._connection)
        except VisionError:
            return None  # revoked, or half-written
        return None if known is None else file_state(known.path)

    def _follow_credentials(self) -> None:
        """Open another session if the credentials were replaced, and a router accepts them."""
        state = None if self._connection.credentials is None else self._credentials_state()
        if state is None or state == self._credentials:
            return
        former = self._session
        self._try_replacement("other credentials", is_connected=True)
        if self._session is not former:
            self._credentials = state

    def _is_answered(self) -> bool:
        """Ask the router for a token that nobody has; return whether it answered in time."""
        until_s = time.monotonic() + 2 * ANSWER_S  # in case not even a time-out is reported
        answer: Future[Replies] = Future()
        query = Query(keys.LINK, timeout_s=ANSWER_S, tokens=True)
        send(self._session, query, answer.set_result)
        while wait([answer], POLL_S).not_done and time.monotonic() < until_s:
            if self._ending():
                return True
        return answer.done() and not answer.result().timed_out

    def _try_replacement(self, why: str, *, is_connected: bool = False) -> None:
        """Replace the session if another can be opened, and its own state has not changed."""
        try:
            session = try_session(self._connection, self._ending)
        except VisionError:  # of files that were changed meanwhile, as the refusal says
            return
        if session is None:
            return
        if self.connected != is_connected or not self._replace(session, why):
            close_session(session)

    def _replace(self, session: zenoh.Session, why: str) -> bool:
        """Declare everything on another session and close the current one."""
        with self._lock:
            if self._ending():
                return False
            try:
                declared = [each.declare(session) for each in self._declared]
            except zenoh.ZError as error:
                log.warning("another session cannot be used: %s", zenoh_error_text(error))
                return False
            former = [each.current for each in self._declared]
            for declaration, current in zip(self._declared, declared, strict=True):
                declaration.use(current)
            former_session, self._session = self._session, session
        log.warning("%s: another session was opened to it", why)
        for each in former:
            if not isinstance(each, zenoh.Publisher):
                with suppress(zenoh.ZError):
                    each.undeclare()
        self._closed.wait(GRACE_S)
        close_session(former_session)
        return True
