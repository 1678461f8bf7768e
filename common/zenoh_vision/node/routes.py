"""The routes on which a camera's frames come to an input, and ``auto``, which chooses among them.

A route follows its own events: an offer, a first frame, a silence. Reading an input routes nothing,
and an input that nobody reads, or that is silent, costs nothing.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import zenoh

from zenoh_vision.host.clock import Clock
from zenoh_vision.keys import RouteName
from zenoh_vision.stream.intake import Intake
from zenoh_vision.stream.sample import Sample
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.subscriber import subscribe

SILENT_S = 3.0
"""A route is silent after this time without a frame, or after three times the time between its last
two: longer than ``zv camera`` takes to start, so that a camera that is just starting need not make
raw pixels, and longer than a slow camera takes for a frame."""

MOST_SILENT_S = 60.0
JOIN_S = 1.0


class Route(ABC):
    """One way on which the frames of a key come; may be started and stopped on any thread."""

    def __init__(self, key: str) -> None:
        self.key = key
        self._noticed: Callable[[Sample | None], None] = lambda _: None

    def watch(self, noticed: Callable[[Sample | None], None]) -> None:
        """Call a function after each good frame, and with None when ``available`` has changed."""
        self._noticed = noticed

    @property
    def available(self) -> bool:
        """Whether frames that are published reach it; not so where a camera must offer it."""
        return True

    @property
    def fault(self) -> str:
        """Why no frames come on it although they are offered; empty if they do."""
        return ""

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that it subscribes to now; frames in shared memory are the compressed ones."""
        return (self.key,)

    @property
    def awaited(self) -> str:
        """Where the first frame may come from, for people."""
        return self.key

    @abstractmethod
    def start(self) -> None:
        """Begin to take frames; has no effect if it was started."""

    @abstractmethod
    def stop(self) -> None:
        """Take no more frames; has no effect if it was not started."""


class TopicRoute(Route):
    """Frames over Zenoh, from one key.

    Its name is ``jpeg`` for compressed frames, ``raw`` for raw pixels.
    """

    def __init__(self, link: Link, intake: Intake[Any, Any], key: str, name: RouteName) -> None:
        super().__init__(key)
        self._link = link
        self._intake = intake
        self._name = name
        self._subscription: Declaration[zenoh.Subscriber[None]] | None = None
        self._lock = threading.Lock()

    def start(self) -> None:
        """Subscribe."""
        with self._lock:
            if self._subscription is None:
                self._subscription = subscribe(
                    self._link, self._intake, self.key, route=self._name, delivered=self._noticed
                )

    def stop(self) -> None:
        """Unsubscribe."""
        with self._lock:
            subscription, self._subscription = self._subscription, None
        if subscription is not None:
            subscription.undeclare()


class AutoRoute(Route):
    """Shared memory if camera and consumer have it in common, else compressed, else raw frames.

    The compressed key is subscribed to from the start, which costs nothing while nobody publishes
    on it. As soon as a frame came through shared memory, that subscription ends, so that the camera
    need not encode; it begins again when the offer disappears. Raw pixels over Zenoh are ten times
    as large, and a camera that has both makes each only for subscribers. So the raw key is
    subscribed to only after a silence, until a frame comes on a cheaper route. The routers' list of
    publishers would show sooner which of the two is published, but Zenoh 1.10 can hang a router
    that is queried for it while a publisher is being declared.

    Args:
        routes: Those to choose from, the cheapest first. One that a camera must offer is taken
            whenever it does; of the others those up to the cheapest that delivers, or all after a
            silence.
        clock: Measures silence.
    """

    def __init__(self, routes: Sequence[Route], clock: Clock) -> None:
        offered = [route for route in routes if not route.available]
        self._offered = offered
        self._topics = [route for route in routes if route not in offered]
        super().__init__(self._topics[0].key)
        self._routes = tuple(routes)
        self._clock = clock
        self._since_ns: dict[Route, int] = {}
        self._gap_ns: dict[Route, int] = {}
        self._started_ns = 0
        self._current: Route | None = None  # the cheapest that delivers
        self._wanted: list[Route] = []
        self._lock = threading.Lock()  # for what is wanted, and for the start and stop of routes
        self._changed = threading.Condition()
        self._is_due = False
        self._running = False
        self._thread: threading.Thread | None = None
        for route in routes:
            route.watch(partial(self._notice, route))

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that it subscribes to now; frames in shared memory are the compressed ones."""
        return tuple(each.key for each in self._wanted if each in self._topics) or (self.key,)

    @property
    def awaited(self) -> str:
        """Where the first frame may come from."""
        return " or ".join(each.key for each in self._topics)

    @property
    def fault(self) -> str:
        """Why no frames come on a route that is offered."""
        return "; ".join(each.fault for each in self._offered if each.fault)

    def start(self) -> None:
        """Take compressed frames, and those in shared memory when they are offered."""
        with self._lock:
            if self._running:
                return
            self._running = True
        self._started_ns = self._clock.monotonic_ns()
        self._follow()  # here, so that nothing is missed that is published after this call
        self._thread = threading.Thread(target=self._run, name="route", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop all routes."""
        with self._lock:
            self._running = False
            wanted, self._wanted = self._wanted, []
            for route in wanted:
                route.stop()
        self.wake()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(JOIN_S)

    def wake(self) -> None:
        """Look again at what delivers, soon and on the route's own thread."""
        with self._changed:
            self._is_due = True
            self._changed.notify()

    def _notice(self, route: Route, sample: Sample | None) -> None:
        """Note a frame, or a change of what is available; called for each frame, so quick."""
        if sample is not None:
            before_ns = self._since_ns.get(route)
            self._since_ns[route] = sample.arrived_ns
            self._gap_ns[route] = 0 if before_ns is None else sample.arrived_ns - before_ns
            current = self._current
            if route is current:
                return
            if current is not None and self._routes.index(current) < self._routes.index(route):
                return
        self.wake()

    def _silent_ns(self, route: Route | None) -> int:
        """Return when a route is silent, or the start has been; monotonic."""
        gap_s = 0.0 if route is None else self._gap_ns.get(route, 0) / 1e9
        since_ns = self._started_ns if route is None else self._since_ns[route]
        return since_ns + round(min(MOST_SILENT_S, max(SILENT_S, 3 * gap_s)) * 1e9)

    def _run(self) -> None:
        while self._running:
            wait_s = self._follow()
            with self._changed:
                if not self._is_due and self._running:
                    self._changed.wait(wait_s)
                self._is_due = False

    def _follow(self) -> float | None:
        """Start and stop routes by what delivers; return after which time to look again.

        None: nothing delivers, so there is nothing to do before the next event.
        """
        now_ns = self._clock.monotonic_ns()
        delivering = (
            route
            for route in self._routes
            if route in self._since_ns and route.available and now_ns < self._silent_ns(route)
        )
        self._current = current = next(delivering, None)
        newest = max(self._since_ns, key=self._since_ns.__getitem__, default=None)
        due_ns = self._silent_ns(current or newest)
        silent = now_ns >= due_ns
        if current in self._offered:
            topics = []
        elif current is not None:
            topics = self._topics[: self._topics.index(current) + 1]
        else:
            topics = self._topics if silent else self._topics[:-1]
        wanted = [*self._offered, *topics]
        with self._lock:
            if not self._running:
                return None
            for route in wanted:
                route.start()
            for route in self._wanted:
                if route not in wanted:
                    route.stop()
            self._wanted = wanted
        return None if silent else (due_ns - now_ns) / 1e9
