"""Parameters of a running node, in revisions that are replaced as a whole.

A change makes a new revision. A consumer activates the newest one between two frames and works
with it until the frame is done.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from zenoh_vision.config.parameters import changed
from zenoh_vision.config.settings import Settings

log = logging.getLogger(__name__)

S = TypeVar("S", bound=Settings)


@dataclass(frozen=True, slots=True)
class Revision(Generic[S]):
    """The settings between two changes; numbered from 0."""

    number: int
    settings: S


@dataclass(frozen=True, slots=True)
class Change(Generic[S]):
    """One step from a revision to the next.

    Attributes:
        names: Names of the options whose value changed; if empty, ``before`` and ``after`` are
            the same.
    """

    before: Revision[S]
    after: Revision[S]
    names: tuple[str, ...]


class ParameterStore(Generic[S]):
    """The settings of one node and their revisions; safe between threads."""

    def __init__(self, settings: S) -> None:
        self._checks: list[Callable[[S], None]] = []
        self._newest = Revision(0, settings)
        self._active = self._newest
        self._watchers: list[Callable[[Change[S]], None]] = []
        self._undelivered: deque[Change[S]] = deque()
        self._delivering = False
        self._lock = threading.Lock()

    @property
    def newest(self) -> Revision[S]:
        """The revision for the next frame."""
        return self._newest

    @property
    def active(self) -> Revision[S]:
        """The revision with which the current frame is processed."""
        return self._active

    def activate(self) -> Revision[S]:
        """Make the newest revision the active one; called between two frames."""
        self._active = self._newest
        return self._active

    def check(self, check: Callable[[S], None]) -> None:
        """Call ``check`` before each change. Adding the same function again has no effect.

        It raises ``ParameterRefused`` for settings that are valid, but cannot be applied now.
        """
        with self._lock:
            if check not in self._checks:
                self._checks.append(check)

    def watch(self, watcher: Callable[[Change[S]], None]) -> None:
        """Call ``watcher`` after each change, in order, on the thread of a change."""
        with self._lock:
            self._watchers.append(watcher)

    def change(self, values: Mapping[Any, object]) -> Change[S]:
        """Change some options, all or none; simultaneous changes are made one after the other.

        Raises:
            ParameterRefused: Something is wrong with one of them; nothing has changed.
        """
        with self._lock:
            before = self._newest
            settings = changed(before.settings, values)
            for check in self._checks:
                check(settings)
            names = tuple(
                name
                for name in type(settings).model_fields
                if getattr(settings, name) != getattr(before.settings, name)
            )
            if not names:
                return Change(before, before, ())
            self._newest = Revision(before.number + 1, settings)
            change = Change(before, self._newest, names)
            self._undelivered.append(change)
            if self._delivering:
                return change
            self._delivering = True
        self._deliver()
        return change

    def _deliver(self) -> None:
        """Call the watchers without the lock, since they may take long or read this store."""
        while True:
            with self._lock:
                if not self._undelivered:
                    self._delivering = False
                    return
                change = self._undelivered.popleft()
            for watcher in tuple(self._watchers):
                try:
                    watcher(change)
                except Exception:
                    log.exception("a watcher of parameters failed")
