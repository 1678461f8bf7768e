"""Receives the newest calibration of one camera from its ``camera_info``."""

from __future__ import annotations

import threading
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import zenoh

from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.errors import PayloadError
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES
from zenoh_vision.messages import CameraInfo, Header
from zenoh_vision.node.node import Node
from zenoh_vision.topics import topic_named
from zenoh_vision.transport.query import Query, Replies, send
from zenoh_vision.transport.session import direct

REPLY_S: Final = 0.25
"""How long the first frame of an epoch waits for the reply to the query for a calibration."""

MAX_WAITING: Final = 16
"""Calibrations that wait for the next frame; when there are more, the oldest are dropped."""


@dataclass(frozen=True, slots=True)
class _Arrival:
    """A calibration received on Zenoh's thread, to be processed by the loop of the service."""

    sample: zenoh.Sample | None  # the published sample or the reply; None if a query had no reply
    query: int = 0  # number of the query that it answers; 0 if it was published


class CalibrationSource:
    """Receives the calibrations of one camera of an open node.

    A calibration may arrive at any time, from the camera or from another program. It is subscribed
    to, and queried at the first frame of each epoch, since it may have been published before. If
    its publisher answers queries, the calibration is dropped at the first query without a reply:
    the camera was started again without one. If it was only published, it stays until another one
    arrives. An invalid calibration is dropped and counted, and the previous one stays.
    """

    def __init__(self, node: Node, camera: str) -> None:
        self._node = node
        self._camera = camera
        self._key = topic_named("camera_info").key(node.connection.namespace, camera)
        self._arrived: deque[_Arrival] = deque(maxlen=MAX_WAITING)
        self._calibration: Calibration | None = None
        self._is_answered = False  # whether the calibration's publisher answers queries
        self._query = 0  # number of the newest query
        self._published_since = False  # whether a calibration was published since that query
        self._run: tuple[int, int] | None = None
        self._replied = threading.Event()
        node.link.declare(
            lambda session: session.declare_subscriber(self._key, direct(self._receive))
        )

    def newest(self, header: Header) -> Calibration | None:
        """Return the calibration that holds for a frame, of any size; None without one."""
        self._process_all()
        if header.run != self._run:
            self._run = header.run
            self._send_query()
            # Otherwise it would depend on the network with which frame the calibration begins.
            self._replied.wait(REPLY_S)
            self._process_all()
        return self._calibration

    def _receive(self, sample: zenoh.Sample) -> None:
        """Keep a published calibration for the loop, which may wait for a frame for long."""
        size = len(sample.payload)
        if size > MAX_MESSAGE_BYTES:
            self._drop(PayloadError("bad_calibration", f"{size} bytes"))
        else:
            self._arrived.append(_Arrival(sample))

    def _drop(self, error: PayloadError) -> None:
        # Not ``node.drop``, which drops the frame that the loop works on.
        self._node.counters.arrive()
        self._node.counters.drop(error.reason)
        self._node.health.log_drop(error)

    def _send_query(self) -> None:
        self._query += 1
        self._published_since = False
        number, replied = self._query, threading.Event()
        self._replied = replied

        def done(replies: Replies) -> None:
            samples = [reply.ok for reply in replies if reply.ok is not None]
            if samples or not replies.timed_out:
                self._arrived.append(_Arrival(samples[-1] if samples else None, number))
            replied.set()

        with suppress(zenoh.ZError):  # the session is being closed or replaced
            send(self._node.link.session, Query(self._key), done)

    def _process_all(self) -> None:
        while self._arrived:
            self._process(self._arrived.popleft())

    def _process(self, arrival: _Arrival) -> None:
        calibration = None
        if arrival.sample is not None:
            try:
                calibration = self._read(arrival.sample)
            except PayloadError as error:
                self._drop(error)
                return
        if arrival.query == 0:
            self._calibration, self._is_answered = calibration, False
            self._published_since = True
        elif arrival.query != self._query:
            return  # a reply to the query of an earlier epoch
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
