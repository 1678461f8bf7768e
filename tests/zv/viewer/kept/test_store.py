"""The file of kept events: what is found in it again, its limits, and its faults."""

from __future__ import annotations

import os
import sqlite3
import stat
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.headers import header
from zenoh_vision.messages import TrackEvent
from zv.viewer.kept import store as module
from zv.viewer.kept.store import EventStore, EventsUnavailable, Picture, Seen, Wanted

DAY_S = 86_400.0
LARGE = 10**9


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "events" / "vision_viewer.sqlite"


@pytest.fixture
def store(path: Path) -> Iterator[EventStore]:
    opened = EventStore(path)
    yield opened
    opened.close()


def event(seq: int, kind: str = "zone_entered", **fields: object) -> TrackEvent:
    camera = fields.pop("camera", "front")
    about = {"header": header(seq, camera=camera), "event": kind, "id": 7, "zone": "belt"}
    return TrackEvent(**{**about, "x": 3.5, "y": 4.0, **fields})


def seqs(store: EventStore, most: int = 100, **wanted: object) -> list[int]:
    return [each["seq"] for each in store.find(Wanted(**wanted), most)]


def test_events_are_found_by_camera_kind_zone_and_time_newest_first(store):
    events = [
        event(1, stamp_ns=100),
        event(2, "zone_left", stamp_ns=200),
        event(3, camera="rear", stamp_ns=300),
        event(4, "line_crossed", zone="gate", direction="left", stamp_ns=400),
    ]
    assert store.add([Seen(each) for each in events], DAY_S, LARGE)
    assert seqs(store) == [4, 3, 2, 1]
    assert seqs(store, camera="front") == [4, 2, 1]
    assert seqs(store, kind="zone_entered") == [3, 1]
    assert seqs(store, zone="gate") == [4]
    assert seqs(store, since_ns=200, until_ns=400) == [3, 2]
    assert seqs(store, zone="' OR 1 --") == []
    number = store.find(Wanted(), 2)[-1]["number"]
    assert seqs(store, most=2) == [4, 3]
    assert seqs(store, before=number) == [2, 1]
    assert seqs(store, after=number) == [4]
    assert store.choices() == {
        "camera": ["front", "rear"],
        "kind": ["line_crossed", "zone_entered", "zone_left"],
        "zone": ["belt", "gate"],
    }


def test_everything_is_there_after_a_restart_and_nobody_else_reads_it(store, path):
    shared = Picture(b"\xff\xd8 one")
    seen = [Seen(event(1), shared, 2, (1, 2, 3, 4)), Seen(event(2, class_name="dog"), shared)]
    assert store.add(seen, DAY_S, LARGE)
    store.close()
    assert [stat.S_IMODE(place.stat().st_mode) for place in (path, path.parent)] == [0o600, 0o700]
    again = EventStore(path)
    second, first = again.find(Wanted(), 10)
    assert (first["track"], first["x"], first["zone"], first["box"]) == (
        7,
        3.5,
        "belt",
        [1, 2, 3, 4],
    )
    assert (first["frames_later"], second["frames_later"]) == (2, None)
    assert (first["class"], second["class"]) == (None, "dog")
    assert first["picture"] == second["picture"]  # it is stored once
    assert again.picture(first["picture"]) == b"\xff\xd8 one"
    assert again.picture(first["picture"] + 1) is None
    again.close()


def test_an_event_that_arrives_again_is_kept_once(store):
    again = [Seen(event(1, zone=None)), Seen(event(1, zone=None)), Seen(event(1, "zone_left"))]
    for _ in range(2):
        assert store.add(again, DAY_S, LARGE)
    assert len(store.find(Wanted(), 10)) == 2


def test_numbers_that_are_too_large_for_the_file_are_kept_as_the_largest(store):
    strange = event(2**64 - 1, id=2**64 - 1, zone="z" * 10_000)
    assert store.add([Seen(strange, None, 2**64)], DAY_S, LARGE)
    (found,) = store.find(Wanted(), 10)
    assert found["seq"] == found["track"] == found["frames_later"] == 2**63 - 1
    assert found["zone"] == "z" * module.LONGEST_NAME


def test_what_is_too_old_is_removed_with_its_picture(store, monkeypatch):
    now_ns = time.time_ns()
    monkeypatch.setattr(module.time, "time_ns", lambda: now_ns)
    store.add([Seen(event(1), Picture(b"old"))], DAY_S, LARGE)
    now_ns += int(DAY_S * 0.9e9)
    store.add([Seen(event(2), Picture(b"new"))], DAY_S, LARGE)
    old, new = (each["picture"] for each in reversed(store.find(Wanted(), 10)))
    now_ns += int(DAY_S * 0.2e9)
    store.add([], DAY_S, LARGE)
    assert seqs(store) == [2]
    assert store.picture(old) is None
    assert store.picture(new) == b"new"


def test_there_are_never_more_than_a_number(store, monkeypatch):
    monkeypatch.setattr(module, "MOST_EVENTS", 30)
    for start in range(0, 100, 10):
        store.add([Seen(event(start + one)) for one in range(10)], DAY_S, LARGE)
    assert seqs(store) == list(range(99, 69, -1))


def test_the_file_never_grows_beyond_its_limit_and_shrinks_to_a_smaller_one(store, path):
    most = 1_200_000
    for seq in range(200):
        store.add([Seen(event(seq), Picture(os.urandom(10_000)))], DAY_S, most)
        assert path.stat().st_size <= most
    kept = seqs(store, most=1000)
    assert kept[0] == 199
    assert len(kept) > 10
    assert all(store.picture(each["picture"]) for each in store.find(Wanted(), 1000))
    store.add([], DAY_S, most // 2)
    assert path.stat().st_size <= most // 2


def test_a_damaged_file_is_moved_aside_and_said(store, path):
    path.parent.mkdir()
    path.write_bytes(b"no database at all" * 1000)
    assert not store.add([Seen(event(1))], DAY_S, LARGE)
    assert "damaged" in store.fault
    assert store.add([Seen(event(2))], DAY_S, LARGE)
    assert seqs(store) == [2]
    assert "vision_viewer.damaged" in store.fault  # until the viewer is started again
    assert path.with_suffix(".damaged").read_bytes().startswith(b"no database")


def test_a_file_that_is_damaged_in_the_middle_is_noticed_while_it_is_read(store, path):
    for seq in range(50):
        store.add([Seen(event(seq), Picture(os.urandom(10_000)))], DAY_S, LARGE)
    store.close()
    with path.open("r+b") as file:
        file.seek(4096)
        file.write(os.urandom(path.stat().st_size - 4096))
    with pytest.raises(EventsUnavailable, match="damaged"):
        store.find(Wanted(), 100)
    assert store.add([Seen(event(1))], DAY_S, LARGE)


def test_a_full_disk_is_said_changes_nothing_and_heals(store, path, monkeypatch):
    store.add([Seen(event(1))], DAY_S, LARGE)
    store._opened.execute("PRAGMA max_page_count = 1")  # as many as there are
    many = [Seen(event(seq), Picture(bytes(10_000))) for seq in range(2, 9)]
    assert not store.add(many, DAY_S, LARGE)
    assert store.fault.endswith("full")
    assert str(path) in store.fault
    assert seqs(store) == [1]
    assert store.fault  # reading is possible, but that keeps nothing
    assert store.add(many, DAY_S, LARGE)
    assert not store.fault
    assert len(seqs(store)) == 8


def test_a_folder_that_cannot_be_made_is_said(tmp_path):
    (tmp_path / "file").touch()
    store = EventStore(tmp_path / "file" / "events.sqlite")
    assert not store.add([Seen(event(1))], DAY_S, LARGE)
    assert store.fault.startswith("events are not kept: ")
    with pytest.raises(EventsUnavailable):
        store.find(Wanted(), 1)


def test_a_file_that_another_has_locked_is_said_and_used_later(store, path, monkeypatch):
    monkeypatch.setattr(module, "WAIT_S", 0.01)
    store.add([], DAY_S, LARGE)
    store.close()
    other = sqlite3.connect(path)
    other.execute("BEGIN EXCLUSIVE")
    assert not store.add([Seen(event(1))], DAY_S, LARGE)
    assert "locked" in store.fault
    other.close()
    assert store.add([Seen(event(1))], DAY_S, LARGE)
    assert not store.fault
