"""Keeps the newest calibration of one camera, from its ``camera_info``."""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import zenoh

from zenoh_vision import CameraInfo, Header, Node, PayloadError
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault
from zenoh_vision.calibration.plane_view import PlaneView
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES
from zenoh_vision.topics import topic_named
from zenoh_vision.transport.query import Query, Replies, send
from zenoh_vision.transport.session import direct

WAITING: Final = 16
"""Calibrations that wait for a frame; of more, the newest."""


@dataclass(frozen=True, slots=True)
class _Arrival:
    """What came on Zenoh's thread, to be read by the tracker's loop.

    Attributes:
        sample: What was published or answered; None if nobody answered.
        question: Number of the question that it answers; 0 if it was published.
    """

    sample: zenoh.Sample | None
    question: int = 0


class CameraPlane:
    """The plane that a camera sees, for each of its frames.

    A calibration may come at any time, from the camera or from another program. It is subscribed
    to, and asked for with the first frame of each epoch, since it may have been published before.
    One whose publisher answers is gone when nobody answers any more: the camera runs again, without
    a calibration. One that was only published stays until another comes. One that is not possible
    is dropped, and the former one stays.

    Args:
        node: The tracker, open.
        camera: The camera's name.
    """

    def __init__(self, node: Node, camera: str) -> None:
        self._node = node
        self._camera = camera
        self._key = topic_named("camera_info").key(node.connection.namespace, camera)
        self._arrived: deque[_Arrival] = deque(maxlen=WAITING)
        self._calibration: Calibration | None = None
        self._is_answered = False  # its publisher answers queries
        self._question = 0
        self._published_since = False  # the question
        self._epoch: int | None = None
        self._view: PlaneView | None = None
        self._made_for: tuple[Calibration | None, int, int] | None = None
        self._subscription = node.link.declare(
            lambda session: session.declare_subscriber(
                self._key, direct(lambda sample: self._arrived.append(_Arrival(sample)))
            )
        )

    def close(self) -> None:
        """End the subscription."""
        self._subscription.undeclare()

    def view(self, header: Header) -> PlaneView | None:
        """Return the way from a frame's pixels to the plane; None without a calibrated plane.

        A calibration for another size of the same shape is scaled; one for another shape is
        not used.
        """
        while self._arrived:
            self._take(self._arrived.popleft())
        if header.epoch != self._epoch:
            self._epoch = header.epoch
            self._ask()
        calibration = self._calibration
        made_for = (calibration, header.width, header.height)
        if self._made_for != made_for:
            self._made_for = made_for
            self._view = _view(calibration, header)
        return self._view

    def _ask(self) -> None:
        self._question += 1
        self._published_since = False
        question = self._question

        def done(replies: Replies) -> None:
            samples = [reply.ok for reply in replies if reply.ok is not None]
            if samples or not replies.timed_out:
                self._arrived.append(_Arrival(samples[-1] if samples else None, question))

        with suppress(zenoh.ZError):  # the session is being closed or replaced
            send(self._node.link.session, Query(self._key), done)

    def _take(self, arrival: _Arrival) -> None:
        calibration = None
        if arrival.sample is not None:
            try:
                calibration = self._read(arrival.sample)
            except PayloadError as error:
                self._node.counters.arrive()
                self._node.drop(error)
                return
        if arrival.question == 0:
            self._calibration, self._is_answered = calibration, False
            self._published_since = True
        elif arrival.question != self._question:
            return  # of an epoch before
        elif arrival.sample is None:
            if self._is_answered:
                self._calibration, self._is_answered = None, False
        elif calibration == self._calibration or not self._published_since:
            self._calibration, self._is_answered = calibration, True

    def _read(self, sample: zenoh.Sample) -> Calibration | None:
        if sample.kind == zenoh.SampleKind.DELETE:
            return None
        if len(sample.payload) > MAX_MESSAGE_BYTES:
            raise PayloadError("bad_calibration", f"{len(sample.payload)} bytes")
        message = CameraInfo.from_bytes(sample.payload.to_bytes())
        if message.header.camera != self._camera:
            raise PayloadError("wrong_camera", f"{message.header.camera!r} on {self._key}")
        return Calibration.of_message(message)


def _view(calibration: Calibration | None, header: Header) -> PlaneView | None:
    if calibration is None:
        return None
    try:
        return calibration.scaled(header.width, header.height).view
    except CalibrationFault:
        return None
