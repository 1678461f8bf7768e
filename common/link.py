"""A node's link to its router: a session, and what is declared on it, declared anew on the next.

Zenoh reconnects a session by itself, with the patience that the session was opened with. Where
that has become too little, because the link got slower, only another session can connect.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, Generic, Protocol, TypeVar

import zenoh

from common.connection import Connection
from common.session import close_session, open_another, open_session
from common.zenoh_config import plain

log = logging.getLogger(__name__)

ANEW_AFTER_S = 10.0
"""Without a router for so long, another session is tried; a session in use takes at most 1 s."""

LOOK_S = 0.5
GRACE_S = 0.5
"""What another thread has just taken from the old session is used within it."""

END_S = 1.0
LONGEST_ATTEMPT_S = 1.7


class Undeclarable(Protocol):
    """What a session declares: a publisher, a subscriber, a queryable, a token."""

    def undeclare(self) -> Any:
        """End it."""


T = TypeVar("T", bound=Undeclarable)


class Declaration(Generic[T]):
    """Something declared on a link, on whichever session that has.

    Attributes:
        now: What the session of now declared. Not to be kept.
    """

    def __init__(self, link: Link, make: Callable[[zenoh.Session], T], session: zenoh.Session):
        self._link = link
        self.make = make
        self.now = make(session)

    def undeclare(self) -> None:
        """End it, for good."""
        self._link.forget(self)


class Link:
    """A session that is replaced by another if it reaches nobody for 10 s.

    Args:
        connection: Where the router is, and how long to wait for it now.
        waiting_is_over: Asked again and again while it waits for the router now.
        stopping: Whether to try no other session any more, since the end is near.

    Raises:
        RouterUnreachable: No router within the connection's time.
        ToldToStop: Told to stop before there was one.
        ConfigurationError: As for ``client_config``.
    """

    def __init__(
        self,
        connection: Connection,
        waiting_is_over: Callable[[], bool] = lambda: False,
        stopping: Callable[[], bool] = lambda: False,
    ) -> None:
        self._connection = connection
        self._stopping = stopping
        self._session = open_session(connection, waiting_is_over)
        self._declared: list[Declaration[Any]] = []
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._look_after, name="link", daemon=True)
        self._thread.start()

    @property
    def session(self) -> zenoh.Session:
        """The session of now, to put and to ask with. What is declared on it ends with it."""
        return self._session

    @property
    def connected(self) -> bool:
        """Whether a router is there at the moment."""
        return _any(self._session.info.routers_zid)

    def declare(self, make: Callable[[zenoh.Session], T]) -> Declaration[T]:
        """Declare something on this session, and on each that replaces it.

        Args:
            make: Declares it; called once for every session, on any thread.
        """
        with self._lock:
            declared = Declaration(self, make, self._session)
            self._declared.append(declared)
        return declared

    def forget(self, declared: Declaration[Any]) -> None:
        """Undeclare something."""
        with self._lock:
            if declared not in self._declared:
                return
            self._declared.remove(declared)
        declared.now.undeclare()

    def close(self) -> None:
        """Close the session in bounded time, whatever the router does."""
        self._closed.set()
        if self._lock.acquire(timeout=END_S):  # it may be being replaced just now
            self._lock.release()
        closing = threading.Thread(target=close_session, args=(self._session,), daemon=True)
        closing.start()
        # An interpreter that ends while Zenoh opens a session on another thread aborts.
        self._thread.join(LONGEST_ATTEMPT_S)
        closing.join(END_S)

    def _ending(self) -> bool:
        return self._closed.is_set() or self._stopping()

    def _look_after(self) -> None:
        seen_s = time.monotonic()
        while not self._closed.wait(LOOK_S):
            try:
                if _reaches_somebody(self._session) or self._stopping():
                    seen_s = time.monotonic()
                elif time.monotonic() - seen_s > ANEW_AFTER_S:
                    self._try_another()
                    seen_s = time.monotonic()
            except Exception:
                log.exception("no other session to the router could be tried")
                seen_s = time.monotonic()

    def _try_another(self) -> None:
        another = open_another(self._connection, self._ending)
        if another is None:
            return
        if _reaches_somebody(self._session) or not self._replace(another):
            close_session(another)

    def _replace(self, another: zenoh.Session) -> bool:
        """Declare everything on another session and close the one there was."""
        with self._lock:
            if self._ending():
                return False
            try:
                made = [declared.make(another) for declared in self._declared]
            except zenoh.ZError as error:
                log.warning("another session to the router is of no use: %s", plain(error))
                return False
            former = [declared.now for declared in self._declared]
            for declared, now in zip(self._declared, made, strict=True):
                declared.now = now
            before, self._session = self._session, another
        log.warning("no router for %g s: another session was opened to it", ANEW_AFTER_S)
        for each in former:
            if not isinstance(each, zenoh.Publisher):
                with suppress(zenoh.ZError):
                    each.undeclare()
        self._closed.wait(GRACE_S)
        close_session(before)
        return True


def _reaches_somebody(session: zenoh.Session) -> bool:
    """Tell whether a session is connected; to a peer too, which we do not look for."""
    return _any(session.info.routers_zid) or _any(session.info.peers_zid)


def _any(found: Callable[[], Iterable[object]]) -> bool:
    try:
        return any(True for _ in found())
    except zenoh.ZError:
        return False  # the session is being closed
