"""The table of ``zv track`` has every frame that has arrived."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.messages import Centroid, Header, Tracks
from zenoh_vision.topics import CENTROID, TRACKS
from zenoh_vision.transport.router import private_router
from zv.tracker.settings import TrackerSettings
from zv.tracker.table import NAMESPACE, Arrivals, Table, _track


def header(seq: int) -> Header:
    return Header(camera="front", epoch=1, seq=seq, stamp_ns=1, width=64, height=48)


class Payload:
    """The bytes of a frame's tracks; while they are read, the other thread may run."""

    def __init__(self, seq: int, meanwhile: Any) -> None:
        self._bytes = Tracks(header=header(seq), tracks=()).to_bytes()
        self._meanwhile = meanwhile

    def to_bytes(self) -> bytes:
        self._meanwhile()
        return self._bytes


def test_a_frame_that_arrives_while_others_are_written_is_not_lost():
    session: Any = SimpleNamespace(declare_subscriber=lambda _key, _handler: None)
    arrived, table = Arrivals(session, "front"), Table(io.StringIO(), mot=False)
    for seq in range(3):
        sample: Any = SimpleNamespace(payload=Payload(seq, lambda: arrived.pass_on(table)))
        arrived._note(sample)
    arrived.pass_on(table)
    assert (table.frames, table.newest) == (3, (1, 2))


class Ended:
    """A process that has ended well."""

    status = 0

    def __init__(self, *_: object) -> None:
        pass

    def __enter__(self) -> Ended:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def check(self, expected: int | None = None) -> None:
        pass

    def pass_on_warnings(self) -> None:
        pass


@pytest.mark.parametrize("lost", [False, True])
def test_what_arrives_after_the_camera_has_ended_is_in_the_table_or_its_lack_is_said(
    monkeypatch: pytest.MonkeyPatch, lost: bool
):
    @contextmanager
    def router() -> Iterator[tuple[zenoh.Session, str]]:
        with private_router() as (session, endpoint):

            def answer(query: zenoh.Query) -> None:
                centroid = Centroid(header=header(1), x=None, y=None, box=None, area=None)
                query.reply(CENTROID.key(NAMESPACE, "front"), centroid.to_bytes())
                for seq in range(2 - lost):
                    tracks = Tracks(header=header(seq), tracks=())
                    session.put(TRACKS.key(NAMESPACE, "front"), tracks.to_bytes())

            session.declare_queryable(CENTROID.key(NAMESPACE, "front"), answer)
            yield session, endpoint

    monkeypatch.setattr("zv.tracker.table.private_router", router)
    monkeypatch.setattr("zv.tracker.table.Child", Ended)
    monkeypatch.setattr("zv.tracker.table.LATE_S", 0.5 if lost else 10.0)
    table = Table(io.StringIO(), mot=False)
    settings = TrackerSettings(camera="front")
    if lost:
        with pytest.raises(ExpectationNotMet, match="the tracks of frame 1 did not"):
            _track(settings, "walk.avi", table, lambda: False)
    else:
        _track(settings, "walk.avi", table, lambda: False)
    assert table.frames == 2 - lost
