"""Which of a camera's two keys an input subscribes to, by what arrives."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from tests.support.intakes import JPEG, PIXELS, Taker, sample
from zenoh_vision.node import transport_switch
from zenoh_vision.node.transport_switch import TransportSwitch

COMPRESSED, RAW, SHM = "vision/r1/image/compressed", "vision/r1/image", "shared memory"
S = 10**9


class Memory:
    """The frames in shared memory, which a camera offers while ``receiving``."""

    def __init__(self) -> None:
        self.receiving = self.wanted = False
        self.failure = ""

    def follow(self, *, wanted: bool) -> None:
        self.wanted = wanted


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
        self.memory = Memory()
        memory: Any = self.memory
        self._switch = TransportSwitch(link, self.intake, RAW, memory)

    def _subscribe(self, _link: object, _intake: object, key: str) -> Any:
        self.subscribed.add(key)
        return SimpleNamespace(undeclare=lambda: self.subscribed.discard(key))

    def after(self, seconds: float, transport: Any = "auto", came: str = "") -> set[str]:
        """Let time pass, perhaps let a frame come on a key, and return what is subscribed to."""
        self.now_ns += round(seconds * S)
        if came:
            self._seq += 1
            payload = JPEG if came == COMPRESSED else PIXELS.tobytes()
            shared, key = came == SHM, RAW if came == SHM else came
            self.intake.receive(
                sample(self._seq, payload, key, arrived_ns=self.now_ns, shared=shared)
            )
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


def test_compressed_frames_are_taken_until_one_came_through_shared_memory(system):
    assert system.after(0) == {COMPRESSED}
    assert system.memory.wanted
    system.memory.receiving = True
    assert system.after(1) == {COMPRESSED}
    assert system.after(0.1, came=COMPRESSED) == {COMPRESSED}
    assert system.after(0.1, came=SHM) == set()
    assert system.intake.keys == (COMPRESSED,)
    for _ in range(3):
        assert system.after(2.9, came=SHM) == set()


def test_they_are_taken_again_when_the_offer_goes_and_when_nothing_comes_for_3_s(system):
    system.memory.receiving = True
    assert system.after(1, came=SHM) == set()
    system.memory.receiving = False
    assert system.after(0.1) == {COMPRESSED}
    system.memory.receiving = True
    assert system.after(0.1, came=SHM) == set()
    assert system.after(2.9) == set()
    assert COMPRESSED in system.after(0.1)


def test_what_came_is_looked_at_ten_times_a_second_and_another_transport_is_followed_at_once(
    system,
):
    system.memory.receiving = True
    assert system.after(1) == {COMPRESSED}
    assert system.after(0.099, came=SHM) == {COMPRESSED}
    assert system.after(0.001) == set()
    assert system.after(0, "raw") == {RAW}


@pytest.mark.parametrize(("transport", "keys"), [("raw", {RAW}), ("jpeg", {COMPRESSED})])
def test_shared_memory_is_not_used_with_another_transport(system, transport, keys):
    system.memory.receiving = True
    system.after(1, came=SHM)
    assert system.after(0, transport) == keys
    assert not system.memory.wanted


def test_shared_memory_alone_subscribes_to_nothing_else_however_long_nothing_comes(system):
    assert system.after(0, "shm") == set()
    assert system.after(9, "shm") == set()
    assert system.memory.wanted
    assert [state.key for state in system.intake.states()] == [f"{RAW} in shared memory"]
