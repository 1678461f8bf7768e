"""Which of a camera's two keys an input subscribes to, by what arrives."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from tests.support.intakes import JPEG, PIXELS, Taker, sample
from zenoh_vision.node import transport_switch
from zenoh_vision.node.transport_switch import TransportSwitch

COMPRESSED, RAW = "vision/r1/image/compressed", "vision/r1/image"
S = 10**9


class System:
    """A switch, its clock, and the keys it subscribes to."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.subscribed: set[str] = set()
        monkeypatch.setattr(transport_switch, "subscribe", self._subscribe)
        clock = SimpleNamespace(monotonic_ns=lambda: self.now_ns)
        monkeypatch.setattr(transport_switch, "time", clock)
        self.intake = Taker().frames(COMPRESSED, raw_key=RAW)
        self.now_ns = self.intake.newest[1]  # when it was opened
        self._seq = 0
        link: Any = None
        self._switch = TransportSwitch(link, self.intake, RAW)

    def _subscribe(self, _link: object, _intake: object, key: str) -> Any:
        self.subscribed.add(key)
        return SimpleNamespace(undeclare=lambda: self.subscribed.discard(key))

    def after(self, seconds: float, transport: Any = "auto", came: str = "") -> set[str]:
        """Let time pass, perhaps let a frame come on a key, and return what is subscribed to."""
        self.now_ns += round(seconds * S)
        if came:
            self._seq += 1
            payload = JPEG if came == COMPRESSED else PIXELS.tobytes()
            self.intake.receive(sample(self._seq, payload, came, arrived_ns=self.now_ns))
        self._switch.follow(transport)
        return set(self.subscribed)


@pytest.fixture
def system(monkeypatch: pytest.MonkeyPatch) -> System:
    return System(monkeypatch)


def test_raw_and_jpeg_mean_that_key_alone(system):
    assert system.after(0, "raw") == {RAW}
    assert system.intake.keys == (RAW,)
    assert system.after(9, "jpeg") == {COMPRESSED}
    assert system.after(9, "raw") == {RAW}


@pytest.mark.parametrize(
    ("transport", "named"),
    [("auto", f"{COMPRESSED} or {RAW}"), ("raw", RAW), ("jpeg", COMPRESSED)],
)
def test_silence_is_that_of_every_key_that_would_be_taken(system, transport, named):
    system.after(0, transport)
    assert [state.key for state in system.intake.states()] == [named]
    came = COMPRESSED if transport == "jpeg" else RAW
    system.after(1, transport, came=came)
    assert [state.key for state in system.intake.states()] == [came]


def test_raw_pixels_are_taken_too_when_nothing_came_for_3_s(system):
    assert system.after(2.9) == {COMPRESSED}
    assert system.after(0.1) == {COMPRESSED, RAW}
    assert system.intake.keys == (COMPRESSED, RAW)


def test_raw_pixels_are_not_taken_while_compressed_frames_come(system):
    for _ in range(5):
        assert system.after(2.9, came=COMPRESSED) == {COMPRESSED}
    assert system.after(2.9) == {COMPRESSED}
    assert system.after(0.1) == {COMPRESSED, RAW}


def test_compressed_frames_end_the_raw_ones_whenever_they_come(system):
    system.after(3)
    assert system.after(1, came=RAW) == {COMPRESSED, RAW}
    assert system.after(1, came=COMPRESSED) == {COMPRESSED}
    assert system.after(0.5) == {COMPRESSED}


def test_raw_frames_that_flow_are_kept_until_a_compressed_one_comes(system):
    system.after(3)
    for _ in range(5):
        assert system.after(2.9, came=RAW) == {COMPRESSED, RAW}
    assert system.after(0.1, came=COMPRESSED) == {COMPRESSED}
