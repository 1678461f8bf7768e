"""Keeps the newest calibration of one camera, from its ``camera_info``."""

from __future__ import annotations

import threading
from contextlib import suppress

import zenoh

from zenoh_vision import CameraInfo, Header, Node, PayloadError
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault
from zenoh_vision.calibration.plane_view import PlaneView
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES
from zenoh_vision.topics import topic_named
from zenoh_vision.transport.query import Query, Replies, send
from zenoh_vision.transport.session import direct


class CameraPlane:
    """The plane that a camera sees, for each of its frames; safe between threads.

    A calibration may come at any time. It is subscribed to, and asked for with the first frame of
    each epoch, since it may have been published before. If then nobody answers, and none came
    since the epoch before began, there is none any more. One that is not possible is dropped, and
    the former one stays.

    Args:
        node: The tracker, open.
        camera: The camera's name.
    """

    def __init__(self, node: Node, camera: str) -> None:
        self._node = node
        self._camera = camera
        self._key = topic_named("camera_info").key(node.connection.namespace, camera)
        self._lock = threading.Lock()
        self._calibration: Calibration | None = None
        self._arrived = self._asked_at = 0
        self._epoch: int | None = None
        self._view: PlaneView | None = None
        self._made_for: tuple[Calibration | None, int, int] | None = None
        self._subscription = node.link.declare(
            lambda session: session.declare_subscriber(self._key, direct(self._take))
        )

    def close(self) -> None:
        """End the subscription."""
        self._subscription.undeclare()

    def view(self, header: Header) -> PlaneView | None:
        """Return the way from a frame's pixels to the plane; None without a calibrated plane.

        A calibration for another size of the same shape is scaled; one for another shape is
        not used.
        """
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
        with self._lock:
            former, self._asked_at = self._asked_at, self._arrived
            now = self._arrived

        def done(replies: Replies) -> None:
            samples = [reply.ok for reply in replies if reply.ok is not None]
            if samples and self._arrived == now:  # else what was published meanwhile is newer
                self._take(samples[-1])
                with self._lock:
                    self._asked_at = self._arrived  # it came by asking, so it was there before
            elif not samples and not replies.timed_out:
                with self._lock:
                    if self._arrived == former:  # it is of an epoch before
                        self._calibration = None

        with suppress(zenoh.ZError):  # the session is being closed or replaced
            send(self._node.link.session, Query(self._key), done)

    def _take(self, sample: zenoh.Sample) -> None:
        try:
            calibration = self._read(sample)
        except PayloadError as error:
            self._node.counters.arrive()
            self._node.drop(error)
            return
        with self._lock:
            self._arrived += 1
            self._calibration = calibration

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
