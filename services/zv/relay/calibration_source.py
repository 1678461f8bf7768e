"""Receives the newest calibration of a camera: published, or by query at each new epoch."""

from __future__ import annotations

from collections import deque
from contextlib import suppress

import zenoh

from zenoh_vision import CameraInfo, Header, Node, PayloadError
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES
from zenoh_vision.topics import topic_named
from zenoh_vision.transport.query import Query, Replies, send
from zenoh_vision.transport.session import direct

MAX_WAITING = 4


class CalibrationSource:
    """The calibration of one camera, taken by an open node."""

    def __init__(self, node: Node, camera: str) -> None:
        self._node = node
        self._key = topic_named("camera_info").key(node.connection.namespace, camera)
        self._arrived: deque[zenoh.Sample] = deque(maxlen=MAX_WAITING)
        self._calibration: Calibration | None = None
        self._scaled: tuple[Calibration, int, int, Calibration] | None = None
        self._epoch: int | None = None
        node.link.declare(
            lambda session: session.declare_subscriber(self._key, direct(self._arrived.append))
        )

    def of_frame(self, header: Header) -> Calibration | None:
        """Return the calibration for frames of this size; None if there is none that fits."""
        if header.epoch != self._epoch:
            self._epoch = header.epoch
            self._ask()
        while self._arrived:
            self._take(self._arrived.popleft())
        known = self._calibration
        if known is None:
            return None
        if self._scaled is None or self._scaled[:3] != (known, header.width, header.height):
            try:
                fitting = known.scaled(header.width, header.height)
            except CalibrationFault as fault:
                self._node.report("calibration", 1, str(fault))
                return None
            self._node.report("calibration", 0)
            self._scaled = (known, header.width, header.height, fitting)
        return self._scaled[3]

    def _ask(self) -> None:
        def done(replies: Replies) -> None:
            self._arrived.extend(reply.ok for reply in replies if reply.ok is not None)

        with suppress(zenoh.ZError):  # the session is being closed or replaced
            send(self._node.link.session, Query(self._key), done)

    def _take(self, sample: zenoh.Sample) -> None:
        try:
            if len(sample.payload) > MAX_MESSAGE_BYTES:
                raise PayloadError("bad_calibration", f"{len(sample.payload)} bytes")
            message = CameraInfo.from_bytes(sample.payload.to_bytes())
            self._calibration = Calibration.of_message(message)
        except PayloadError as error:
            self._node.counters.arrive()
            self._node.drop(error)
