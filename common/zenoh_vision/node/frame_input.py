"""An input of frames: its intake, its subscriptions, and the settings that it follows."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, Protocol, TypeVar, cast, get_args

from zenoh_vision.config.revisions import ParameterStore, Revision
from zenoh_vision.config.settings import Settings
from zenoh_vision.errors import ConfigurationError, ParameterRefused
from zenoh_vision.image.frame import Form, Frame, Want
from zenoh_vision.keys import TRANSPORT_VARIABLE, Transport
from zenoh_vision.node.inputs import Input
from zenoh_vision.node.inputs import Owner as InputOwner
from zenoh_vision.node.shm_input import SharedMemoryInput
from zenoh_vision.node.transport_switch import TransportSwitch
from zenoh_vision.shm.machine import why_impossible
from zenoh_vision.stream.buffer import Buffering, check_buffering
from zenoh_vision.stream.frame_intake import FrameIntake
from zenoh_vision.topics import COMPRESSED, RAW, Topic
from zenoh_vision.transport.connection import Connection

MAX_AGE_S = 0.4

T = TypeVar("T")


class Owner(InputOwner, Protocol):
    """The part of a node that an input of frames uses."""

    connection: Connection


def frame_input(
    node: Owner,
    topic: Topic,
    camera: str,
    *,
    want: Want,
    max_age_s: float | None,
    buffering: Buffering,
    borrow: bool,
    max_pixels: int,
    transport: Transport | None,
) -> Input[Frame]:
    """Return an iterable of a camera's frames, or of all cameras' with ``*``; see ``Node.frames``.

    Raises:
        TypeError: ``buffering`` is neither ``latest`` nor a ``queue(n)``.
        ValueError: The topic carries no pictures, there is no such form or transport, or the
            transport does not fit the topic.
        ConfigurationError: The transport is shared memory, which this process cannot use; the
            environment names a transport that does not exist; or the setting names one that an
            input of all cameras does not have.
    """
    _check_arguments(topic, want, buffering, transport)
    namespace = node.connection.namespace
    if topic is COMPRESSED and camera == "*":
        _check_now_and_later(node.parameters, _check_of_all)
    fits = topic is COMPRESSED and camera != "*"
    if transport is None and fits and buffering.per_key:
        transport = transport_from_environment() or "auto"
    if transport is not None and not fits:
        raise ValueError(f"transport {transport!r} needs {COMPRESSED.name} of one camera")
    raw_key = None if transport is None else RAW.key(namespace, camera)
    intake = FrameIntake(
        topic.key(namespace, camera),
        node.consumer,
        buffering,
        raw=topic.raw,
        raw_key=raw_key,
        borrow=borrow,
        max_pixels=max_pixels,
    )
    switch = None
    if transport is not None and raw_key is not None:
        memory = None
        # A loop activates the newest revision before its first frame.
        newest = None if node.parameters is None else node.parameters.newest
        first = _transport(newest, transport)
        _check_possible(first)
        _check_now_and_later(node.parameters, _check_setting)
        if not why_impossible():
            memory = SharedMemoryInput(node.link, namespace, camera, intake, raw_key)
        # A queue needs every frame, and in shared memory only the newest waits.
        switch = TransportSwitch(
            node.link, intake, raw_key, memory, memory_by_itself=buffering.per_key
        )
        switch.follow(first)

    def take(timeout_s: float) -> Frame | None:
        revision = None if node.parameters is None else node.parameters.active
        if switch is not None and transport is not None:
            switch.follow(_transport(revision, transport))
        allowed_s = None if max_age_s is None else _setting(revision, "max_age", max_age_s)
        if revision is not None and hasattr(revision.settings, "depth_min"):
            settings = revision.settings
            intake.depth_limits = settings.depth_min, settings.depth_max
        frame = intake.take(timeout_s, want, allowed_s)
        if frame is not None:
            frame.revision = revision
        return frame

    return Input(node, intake, take, switch)


def _check_arguments(
    topic: Topic, want: Want, buffering: Buffering, transport: Transport | None
) -> None:
    """Check what a program without a type checker may pass.

    Raises:
        TypeError: ``buffering`` is neither ``latest`` nor a ``queue(n)``.
        ValueError: The topic carries no pictures, or there is no such form or transport.
    """
    check_buffering(buffering)
    if topic.message is not None:
        raise ValueError(f"{topic.name} carries messages, not pictures; take node.messages")
    if not callable(want) and want not in get_args(Form):
        raise ValueError(f"want={want!r}; allowed: {', '.join(get_args(Form))}, a function")
    if transport is not None and transport not in get_args(Transport):
        raise ValueError(f"transport={transport!r}; allowed: {', '.join(get_args(Transport))}")


def transport_from_environment() -> Transport | None:
    """Return the transport that the environment sets for all inputs; None if it sets none.

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


def _check_now_and_later(
    parameters: ParameterStore[Any] | None, check: Callable[[Settings], None]
) -> None:
    if parameters is not None:
        check(parameters.newest.settings)
        parameters.check(check)


def _check_setting(settings: Settings) -> None:
    _check_possible(getattr(settings, "transport", None))


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
    transport = getattr(settings, "transport", None)
    if transport in ("shm", "raw"):
        raise ParameterRefused(
            f"transport = {transport}: the frames of all cameras come compressed over the network; "
            "name the cameras to take theirs another way",
            "auto, jpeg",
        )


def _transport(revision: Revision[Any] | None, default: Transport) -> Transport:
    """Return the setting ``transport`` of a revision; the default if it names no transport."""
    found = _setting(revision, "transport", default)
    return found if found in get_args(Transport) else default


def _setting(revision: Revision[Any] | None, name: str, default: T) -> T:
    """Return the value of a setting in a revision; the default if it has no such setting."""
    if revision is None:
        return default
    return cast("T", getattr(revision.settings, name, default))
