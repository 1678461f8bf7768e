"""The black box: what it keeps, and what triggers it."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest

from tests.support.node_states import report
from tests.zv.bag.records import FRAME_NS, frame, header
from zenoh_vision.messages import Header, Level, TrackEvent
from zv.bag.record import Record
from zv.bag.recorder.black_box import Memory, Triggers


def event(kind: str, zone: str | None = None) -> Record:
    payload = TrackEvent(
        header=Header.from_bytes(header(1)), event=kind, id=1, zone=zone, x=1.0, y=2.0
    ).to_bytes()
    return Record("vision/front/events", payload, "application/msgpack;vision.TrackEvent.v1")


def health(node: str, level: int) -> Record:
    payload = report(node, stamp_ns=time.time_ns(), level=level).to_bytes()
    return Record(f"@vision/diagnostics/{node}", payload, "application/msgpack")


def test_the_last_seconds_are_kept() -> None:
    memory = Memory(1.0, 10**9)
    for seq in range(100):
        memory.add(frame(seq))
    seqs = [each.number("seq") for each in memory]
    assert seqs == list(range(99 - int(1e9 / FRAME_NS), 100))
    assert memory.shortened is None


def test_the_limit_of_bytes_holds_and_is_told() -> None:
    memory = Memory(100.0, 20_000)
    for seq in range(100):
        memory.add(frame(seq))
    assert 8 <= len(list(memory)) <= 14
    assert memory.shortened is not None
    assert memory.shortened < 1
    memory.add(frame(100, size=50_000))
    assert [each.number("seq") for each in memory] == [100]


@pytest.mark.parametrize(
    ("wanted", "kind", "zone", "reason"),
    [
        (("zone_entered",), "zone_entered", "door", "zone_entered-door"),
        (("zone_entered:door",), "zone_entered", "door", "zone_entered-door"),
        (("zone_entered:door",), "zone_entered", "gate", ""),
        (("zone_entered:door",), "zone_left", "door", ""),
        (("*",), "started", None, "started"),
        (("*:door",), "zone_left", "door", "zone_left-door"),
        ((), "started", None, ""),
    ],
)
def test_events_trigger_by_kind_and_zone(
    wanted: tuple[str, ...], kind: str, zone: str | None, reason: str
) -> None:
    assert Triggers(wanted, (), "vision", "recorder").reason(event(kind, zone)) == reason


def test_a_level_triggers_once_when_it_is_reached_and_not_the_recorder_s_own() -> None:
    triggers = Triggers((), ("error",), "vision", "recorder")
    levels = (Level.OK, Level.ERROR, Level.ERROR, Level.OK, Level.WARN, Level.ERROR)
    reasons = [triggers.reason(health("camera_front", level)) for level in levels]
    assert reasons == ["", "camera_front-error", "", "", "", "camera_front-error"]
    assert triggers.reason(health("recorder", Level.ERROR)) == ""


def test_garbage_triggers_nothing() -> None:
    triggers = Triggers(("*",), ("error",), "vision", "recorder")
    assert triggers.reason(replace(event("started"), payload=b"\xc1")) == ""
    assert triggers.reason(replace(health("a", 2), payload=b"")) == ""


def test_commands_are_taken_once_each() -> None:
    triggers = Triggers((), (), "vision", "recorder")
    triggers.ask("jam")
    assert (triggers.asked(), triggers.asked()) == ("jam", "")
