"""Settings that change while a node runs: whole revisions, never a mix of two.

Whoever changes them makes a new revision. Whoever works with them takes one revision for one
frame and keeps it until that frame is done.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from common.parameters import changed
from common.settings import Settings

S = TypeVar("S", bound=Settings)


@dataclass(frozen=True, slots=True)
class Revision(Generic[S]):
    """The settings as they were from one change to the next.

    Attributes:
        number: From 0, one more with each change.
        settings: All options, live or not.
    """

    number: int
    settings: S


@dataclass(frozen=True, slots=True)
class Change(Generic[S]):
    """One step from a revision to the next.

    Attributes:
        names: Of the options whose value is another; empty if nothing changed, and then
            ``before`` and ``after`` are the same.
    """

    before: Revision[S]
    after: Revision[S]
    names: tuple[str, ...]


class LiveSettings(Generic[S]):
    """The settings of one node; safe to use from several threads.

    Args:
        settings: Those that it starts with.
    """

    def __init__(self, settings: S) -> None:
        self._newest = Revision(0, settings)
        self._in_force = self._newest
        self._watchers: list[Callable[[Change[S]], None]] = []
        self._lock = threading.Lock()

    @property
    def newest(self) -> Revision[S]:
        """What the next frame is made with."""
        return self._newest

    @property
    def in_force(self) -> Revision[S]:
        """What the frame in work is made with."""
        return self._in_force

    @property
    def settings(self) -> S:
        """The options in force."""
        return self._in_force.settings

    def take(self) -> Revision[S]:
        """Let the newest revision be in force; called between two frames by who makes them."""
        self._in_force = self._newest
        return self._in_force

    def watch(self, watcher: Callable[[Change[S]], None]) -> None:
        """Call this after each change, in their order, on the thread of who made it."""
        with self._lock:
            self._watchers.append(watcher)

    def change(self, values: Mapping[Any, object]) -> Change[S]:
        """Change some options, all or none; changes that come at once come one by one.

        Args:
            values: By name.

        Raises:
            ParameterRefused: Something is wrong with one of them; nothing has changed.
        """
        with self._lock:
            before = self._newest
            settings = changed(before.settings, values)
            names = tuple(
                name
                for name in type(settings).model_fields
                if getattr(settings, name) != getattr(before.settings, name)
            )
            if not names:
                return Change(before, before, ())
            after = Revision(before.number + 1, settings)
            change = Change(before, after, names)
            self._newest = after
            for watcher in self._watchers:
                watcher(change)
            return change
