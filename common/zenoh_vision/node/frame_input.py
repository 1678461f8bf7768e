"""Inputs of frames: their intake, their route, and the settings that they follow."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, cast, get_args

from zenoh_vision.config.revisions import Change, Revision
from zenoh_vision.config.roles import option_of, value_of
from zenoh_vision.config.settings import Settings
from zenoh_vision.errors import ConfigurationError, ParameterRefused
from zenoh_vision.image.frame import Frame, View, Want
from zenoh_vision.keys import TRANSPORT_VARIABLE, RouteName, Transport
from zenoh_vision.node.core import Core
from zenoh_vision.node.inputs import Input
from zenoh_vision.node.memory_route import MemoryRoute
from zenoh_vision.node.routes import AutoRoute, Route, TopicRoute
from zenoh_vision.shm.machine import why_impossible
from zenoh_vision.stream.buffer import Buffering, check_buffering
from zenoh_vision.stream.frame_intake import FrameIntake
from zenoh_vision.stream.intake import InputState
from zenoh_vision.topics import COMPRESSED, RAW, Topic

MAX_AGE_S = 0.4


class RoutedFrames:
    """The route of one camera's frames to an intake, as chosen by the setting ``transport``.

    ``memory_by_itself`` tells whether ``auto`` includes shared memory.
    """

    def __init__(
        self,
        core: Core,
        intake: FrameIntake,
        camera: str,
        transport: Transport,
        *,
        memory_by_itself: bool,
    ) -> None:
        self._core = core
        self._intake = intake
        self._camera = camera
        self._memory_by_itself = memory_by_itself
        self._lock = threading.Lock()
        self._stopped = False
        self._transport = transport
        self.route = self._make(transport)
        if core.parameters is not None:
            core.parameters.watch(self._on_change)
            self._choose(core.parameters.newest.settings)  # it may have changed meanwhile
        with self._lock:
            self.route.start()

    def undeclare(self) -> None:
        """Stop the route for good."""
        if self._core.parameters is not None:
            self._core.parameters.unwatch(self._on_change)
        with self._lock:
            self._stopped = True
            self.route.stop()

    def _on_change(self, change: Change[Any]) -> None:
        self._choose(change.after.settings)

    def _choose(self, settings: Settings) -> None:
        wanted = value_of(settings, "transport", self._transport)
        with self._lock:
            if self._stopped or wanted == self._transport:
                return
            self.route.stop()  # first, or both would deliver the same frames
            self._transport, self.route = wanted, self._make(wanted)
            self.route.start()

    def _make(self, transport: Transport) -> Route:
        """Return the route of a transport; shared memory is there if the transport is that."""
        core, intake = self._core, self._intake
        raw_key = RAW.key(core.namespace, self._camera)
        makers: dict[RouteName, Callable[[], Route]] = {
            "shm": lambda: MemoryRoute(core.link, core.namespace, self._camera, intake, core.clock),
            "jpeg": lambda: TopicRoute(core.link, intake, intake.key, "jpeg"),
            "raw": lambda: TopicRoute(core.link, intake, raw_key, "raw"),
        }
        if transport != "auto":
            return makers[transport]()
        if why_impossible() or not self._memory_by_itself:
            del makers["shm"]
        return AutoRoute([make() for make in makers.values()], core.clock)


class FrameInput(Input[Frame]):
    """Frames of a camera, or of all cameras; see ``Node.frames``.

    Raises:
        TypeError: ``buffering`` is neither ``latest`` nor a ``queue(n)``.
        ValueError: The topic carries no pictures, there is no such view or transport, or the
            transport does not fit the topic.
        ConfigurationError: The transport is shared memory, which this process cannot use; the
            environment names a transport that does not exist; or the setting names one that an
            input of all cameras does not have.
    """

    intake: FrameIntake

    def __init__(
        self,
        core: Core,
        topic: Topic,
        camera: str,
        *,
        want: Want,
        max_age_s: float | None,
        buffering: Buffering,
        max_pixels: int,
        transport: Transport | None,
    ) -> None:
        _check_arguments(topic, want, buffering, transport)
        for name, limit in (("max_age_s", max_age_s), ("max_pixels", max_pixels)):
            if limit is not None and not limit > 0:  # NaN is refused too
                raise ValueError(f"{name}={limit}; allowed: above 0")
        settings = None if core.parameters is None else core.parameters.newest.settings
        key = topic.key(core.namespace, camera)
        fits = topic is COMPRESSED and camera != "*"
        if transport is None and fits and buffering.per_key:
            transport = transport_from_environment() or "auto"
        if transport is not None and not fits:
            raise ValueError(f"transport {transport!r} needs {COMPRESSED.name} of one camera")
        intake = FrameIntake(
            key, core.consumer, buffering, encoding=topic.encoding, max_pixels=max_pixels
        )
        self._routed: RoutedFrames | None = None
        if topic is COMPRESSED and camera == "*":
            _check_now_and_later(core, _check_of_all)
        if transport is not None:
            first = value_of(settings, "transport", transport)
            _check_possible(first)
            _check_now_and_later(core, _check_setting)
            # A queue needs every frame, and in shared memory only the newest waits.
            self._routed = RoutedFrames(
                core, intake, camera, first, memory_by_itself=buffering.per_key
            )
        self._want = want
        self._max_age_s = max_age_s
        self._followed: Revision[Any] | None = None
        self._allowed_s = max_age_s
        super().__init__(core, intake, self._routed)

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that it subscribes to now; frames in shared memory are the compressed ones."""
        return self.intake.keys if self._routed is None else self._routed.route.keys

    @property
    def route(self) -> RouteName | None:
        """The route of its newest frame; None before the first."""
        newest = max(self.intake.states(), key=lambda state: state.since_ns)
        return newest.route

    @property
    def fault(self) -> str:
        """Why its frames do not come by the route that was chosen; empty if they do."""
        return "" if self._routed is None else self._routed.route.fault

    def states(self) -> Sequence[InputState]:
        """Return the state of each key that sent frames; of the input as a whole if none did."""
        found = self.intake.states()
        if self._routed is None or found[0].route is not None:
            return found
        return [replace(found[0], key=self._routed.route.awaited)]

    def take(self, timeout_s: float) -> Frame | None:
        """Return the next frame; see ``Input.take``."""
        if self.closed:
            return None
        parameters = self._core.parameters
        revision = None if parameters is None else parameters.active
        if revision is not self._followed and revision is not None:
            self._follow(revision)
        arrival = self.intake.buffer.take(timeout_s)
        if arrival is None:
            return None
        return self.intake.accept(arrival, self._allowed_s, self._want, revision)

    def _follow(self, revision: Revision[Any]) -> None:
        """Take over the settings of a revision that concern this input."""
        self._followed = revision
        settings: Settings = revision.settings
        if self._max_age_s is not None:
            self._allowed_s = value_of(settings, "max_age", self._max_age_s)
        if option_of(type(settings), "depth_min") is not None:
            low: int | None = value_of(settings, "depth_min", None)
            self.intake.depth_limits = low, value_of(settings, "depth_max", None)


def _check_arguments(
    topic: Topic, want: Want, buffering: Buffering, transport: Transport | None
) -> None:
    """Check what a program without a type checker may pass.

    Raises:
        TypeError: ``buffering`` is neither ``latest`` nor a ``queue(n)``.
        ValueError: The topic carries no pictures, or there is no such view or transport.
    """
    check_buffering(buffering)
    if topic.message is not None:
        raise ValueError(f"{topic.name} carries messages, not pictures; take node.messages")
    if not callable(want) and want not in get_args(View):
        raise ValueError(f"want={want!r}; allowed: {', '.join(get_args(View))}, a function")
    if transport is not None and transport not in get_args(Transport):
        raise ValueError(f"transport={transport!r}; allowed: {', '.join(get_args(Transport))}")


def transport_from_environment() -> Transport | None:
    """Return the transport that the environment sets for this process; None if it sets none.

    Raises:
        ConfigurationError: The variable names a transport that does not exist.
    """
    transport = os.environ.get(TRANSPORT_VARIABLE) or None
    known = get_args(Transport)
    if transport is not None and transport not in known:
        raise ConfigurationError(
            f"environment: {TRANSPORT_VARIABLE} = {transport!r} is not allowed; allowed: "
            f"{', '.join(known)}"
        )
    return cast("Transport | None", transport)


def _check_now_and_later(core: Core, check: Callable[[Settings], None]) -> None:
    if core.parameters is not None:
        check(core.parameters.newest.settings)
        core.parameters.check(check)


def _check_setting(settings: Settings) -> None:
    _check_possible(value_of(settings, "transport", None))


def _check_possible(transport: Transport | None) -> None:
    """Refuse a transport over which this process would never get a frame.

    Raises:
        ParameterRefused: It is shared memory, which this process cannot use.
    """
    if transport == "shm" and (why := why_impossible()):
        raise ParameterRefused(f"transport = shm: {why}", "auto, raw, jpeg")


def _check_of_all(settings: Settings) -> None:
    """Refuse a transport that an input of all cameras does not have.

    Raises:
        ParameterRefused: The setting names one.
    """
    transport: Transport | None = value_of(settings, "transport", None)
    if transport in ("shm", "raw"):
        raise ParameterRefused(
            f"transport = {transport}: the frames of all cameras come compressed over the network; "
            "name the cameras to take theirs another way",
            "auto, jpeg",
        )
