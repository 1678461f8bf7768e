"""A camera with a tracker that answer queries, and publish the events that a test wants."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import cv2
import numpy as np
import zenoh

from tests.support.headers import header
from tests.support.viewer.client import IMAGE
from zenoh_vision.messages import Header, Track, TrackEvent, Tracks

PICTURE = bytes(cv2.imencode(".jpg", np.full((480, 640, 3), 90, np.uint8))[1])
EPOCH = time.time_ns()
BOX = (10, 20, 30, 40)


def head(seq: int, **fields: object) -> Header:
    size = {"width": 640, "height": 480}
    return header(seq, EPOCH, stamp_ns=time.time_ns(), **size, **fields)


class Camera:
    """Answers as a camera and its tracker do, with the newest of a foreign program.

    ``asked`` counts the queries for pictures, ``tracks_behind`` is by how many frames the tracks
    are older.
    """

    def __init__(self, client: zenoh.Session) -> None:
        self.client = client
        self.seq = self.tracks_behind = 0
        self.asked = 0
        self.queryables = [
            client.declare_queryable(IMAGE, self._picture),
            client.declare_queryable("vision/front/tracks", self._tracks),
        ]

    def _picture(self, query: zenoh.Query) -> None:
        self.asked += 1
        with query:
            attachment = head(self.seq).to_bytes()
            query.reply(IMAGE, PICTURE, encoding="image/jpeg", attachment=attachment)

    def _tracks(self, query: zenoh.Query) -> None:
        track = Track(id=13, state="confirmed", x=25.0, y=40.0, box=BOX, area=9.0)
        tracks = Tracks(header=head(self.seq - self.tracks_behind), tracks=(track,))
        with query:
            query.reply("vision/front/tracks", tracks.to_bytes())

    def publish(
        self, seq: int, kind: str = "zone_entered", camera: str = "front", **fields: object
    ) -> None:
        about = {"header": head(seq, camera=camera), "event": kind, "id": 13, "zone": "belt"}
        event = TrackEvent(**{**about, "x": 25.0, "y": 40.0, **fields})
        encoding = "application/msgpack;vision.TrackEvent.v1"
        self.client.put(f"vision/{camera}/events", event.to_bytes(), encoding=encoding)


@contextmanager
def event_camera(client: zenoh.Session) -> Iterator[Camera]:
    found = Camera(client)
    try:
        yield found
    finally:
        for each in found.queryables:
            each.undeclare()
