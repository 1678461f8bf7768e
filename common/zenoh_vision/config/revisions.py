"""Parameters of a running node, in revisions that are replaced as a whole.

A change makes a new revision. A consumer activates the newest one between two frames and works
with it until the frame is done.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from zenoh_vision.config.parameter_groups import ParameterGroup, group_name
from zenoh_vision.config.parameters import changed, live_fields
from zenoh_vision.config.settings import Settings
from zenoh_vision.messages import Parameter

log = logging.getLogger(__name__)

S = TypeVar("S", bound=Settings)


@dataclass(frozen=True, slots=True)
class Revision(Generic[S]):
    """The settings between two changes; numbered from 0.

    Attributes:
        grouped: The parameters of groups by name, with their values at its beginning.
    """

    number: int
    settings: S
    grouped: Mapping[str, Parameter] = field(default_factory=dict)

    def value(self, name: str) -> object:
        """Return the value of an option or a grouped parameter; None if there is none."""
        one = self.grouped.get(name)
        return getattr(self.settings, name, None) if one is None else one.value


@dataclass(frozen=True, slots=True)
class Change(Generic[S]):
    """One step from a revision to the next.

    Attributes:
        names: Names of the parameters that changed, came or went; if empty, ``before`` and
            ``after`` are the same.
    """

    before: Revision[S]
    after: Revision[S]
    names: tuple[str, ...]


class ParameterStore(Generic[S]):
    """The settings of one node and their revisions; safe between threads.

    Attributes:
        newest: The revision for the next frame.
        active: The revision with which the current frame is processed.
    """

    def __init__(self, settings: S) -> None:
        self._checks: list[Callable[[S], None]] = []
        self.newest = self.active = Revision(0, settings)
        self._groups: dict[str, ParameterGroup] = {}
        self._watchers: list[Callable[[Change[S]], None]] = []
        self._undelivered: deque[Change[S]] = deque()
        self._delivering = False
        self._lock = threading.RLock()

    def activate(self) -> Revision[S]:
        """Make the newest revision the active one; called between two frames."""
        self.active = self.newest
        return self.active

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

    def unwatch(self, watcher: Callable[[Change[S]], None]) -> None:
        """Call a watcher no more."""
        with self._lock:
            self._watchers.remove(watcher)

    def change(self, values: Mapping[Any, object]) -> Change[S]:
        """Change some options, all or none; simultaneous changes are made one after the other.

        Raises:
            ParameterRefused: Something is wrong with one of them; nothing has changed.
        """
        with self._lock:
            own, of_groups = self._divided(values)
            settings = changed(self.newest.settings, own, self.newest.grouped)
            for check in self._checks:
                check(settings)
            # Last, since it acts on what is outside of this process.
            kept: dict[str, Any] = {}
            for name, part in of_groups.items():
                group = self._groups[name]
                kept[group.table] = {**getattr(settings, group.table), **group.set(part)}
            if kept:
                settings = settings.model_copy(update=kept)
            change = self._step(settings)
        self._deliver()
        return change

    # Groups

    def add(self, group: ParameterGroup) -> None:
        """Add parameters that exist from now on, in place of those of a group of the same name."""
        name = group_name(group.table)
        with self._lock:
            self._groups[name] = group
            self._step(self.newest.settings)
        group.watch(lambda: self._look(group))
        self._deliver()

    def remove(self, group: ParameterGroup) -> None:
        """Remove the parameters of a group, unless another one has taken its place."""
        group.watch(None)
        with self._lock:
            if self._groups.get(group_name(group.table)) is group:
                del self._groups[group_name(group.table)]
                self._step(self.newest.settings)
        self._deliver()

    def current(self) -> Revision[S]:
        """Return the newest revision after a look at the values of all groups."""
        if self._groups:
            with self._lock:
                self._step(self.newest.settings)
            self._deliver()
        return self.newest

    def _look(self, group: ParameterGroup) -> None:
        with self._lock:
            if group in self._groups.values():
                self._step(self.newest.settings)
        self._deliver()

    def _divided(
        self, values: Mapping[Any, object]
    ) -> tuple[dict[Any, object], dict[str, dict[str, object]]]:
        """Return the values of options, and those of each group by their names in it."""
        own: dict[Any, object] = {}
        of_groups: dict[str, dict[str, object]] = {}
        for name, value in values.items():
            group, dot, key = name.partition(".") if isinstance(name, str) else (name, "", "")
            if dot and group in self._groups:
                of_groups.setdefault(group, {})[key] = value
            else:
                own[name] = value
        return own, of_groups

    def _step(self, settings: S) -> Change[S]:
        """Make the revision with these settings and the present values of the groups."""
        before = self.newest
        grouped = {one.name: one for each in self._groups.values() for one in each.parameters()}
        names = [
            name
            for name in live_fields(type(settings))
            if getattr(settings, name) != getattr(before.settings, name)
        ]
        names += [
            name
            for name in {**before.grouped, **grouped}
            if not _same(before.grouped.get(name), grouped.get(name))
        ]
        if not names:
            # Values that the device itself changes all the time, and values that are kept.
            self.newest = Revision(before.number, settings, grouped)
            return Change(self.newest, self.newest, ())
        self.newest = Revision(before.number + 1, settings, grouped)
        change = Change(before, self.newest, tuple(names))
        self._undelivered.append(change)
        return change

    def _deliver(self) -> None:
        """Call the watchers without the lock, since they may take long or read this store."""
        with self._lock:
            if self._delivering:
                return
            self._delivering = True
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


def _same(one: Parameter | None, other: Parameter | None) -> bool:
    """Tell whether nothing of two descriptions differs but a value that changes by itself."""
    if one == other:
        return True
    if one is None or other is None or not {"volatile", "read_only"} & {*(other.flags or ())}:
        return False
    return one.model_copy(update={"value": other.value}) == other
