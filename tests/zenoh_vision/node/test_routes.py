"""Which routes ``auto`` takes, by its own events: what arrives, what is offered, what is silent."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.clocks import SteppedClock
from tests.support.intakes import sample
from tests.support.waiting import wait_until
from zenoh_vision.node.routes import AutoRoute, Route
from zenoh_vision.stream.sample import Sample

COMPRESSED, RAW = "vision/r1/image/compressed", "vision/r1/image"


class Plain(Route):
    """A route that only knows whether it was started; counts how often it is looked at."""

    def __init__(self, key: str, *, offered: bool = True) -> None:
        super().__init__(key)
        self.started = False
        self.offered = offered
        self.looks = 0

    @property
    def available(self) -> bool:
        return self.offered

    def start(self) -> None:
        self.looks += 1
        self.started = True

    def stop(self) -> None:
        self.started = False

    def notice(self, came: Sample | None) -> None:
        self._noticed(came)


class System:
    """An automatic route, its clock, and the routes that it has."""

    def __init__(self) -> None:
        self.clock = SteppedClock()
        self.memory = Plain(COMPRESSED, offered=False)
        self.routes = {"shm": self.memory, "jpeg": Plain(COMPRESSED), "raw": Plain(RAW)}
        self.auto = AutoRoute([*self.routes.values()], self.clock)
        self.auto.start()

    def after(self, seconds: float, *came: str) -> set[str]:
        """Let time pass, perhaps let frames come, and return the routes that are taken then."""
        self.clock.step(seconds)
        for name in came:
            self.routes[name].notice(sample(0, arrived_ns=self.clock.monotonic_ns()))
        return self.settled()

    def settled(self) -> set[str]:
        """Return what is taken once the route's thread has looked at all that happened."""
        for _ in range(2):  # the first look may have begun before
            looks = self.memory.looks
            self.auto.wake()
            wait_until(lambda looks=looks: self.memory.looks > looks)
        return {name for name, route in self.routes.items() if route.started and name != "shm"}


@pytest.fixture
def system() -> Iterator[System]:
    found = System()
    yield found
    found.auto.stop()


def test_raw_pixels_are_taken_too_when_nothing_came_for_3_s(system: System):
    assert system.after(2.9) == {"jpeg"}
    assert system.after(0.1) == {"jpeg", "raw"}
    assert system.auto.keys == (COMPRESSED, RAW)
    assert system.auto.awaited == f"{COMPRESSED} or {RAW}"


def test_raw_pixels_are_not_taken_while_compressed_frames_come(system: System):
    for _ in range(5):
        assert system.after(1, "jpeg") == {"jpeg"}
    assert system.after(2.9) == {"jpeg"}
    assert system.after(0.1) == {"jpeg", "raw"}


def test_raw_frames_that_flow_are_kept_until_a_compressed_one_comes(system: System):
    system.after(3)
    for _ in range(3):
        assert system.after(1, "raw") == {"jpeg", "raw"}
    assert system.after(0.1, "jpeg") == {"jpeg"}
    assert system.after(0.5, "raw") == {"jpeg"}, "one that was on its way"


def test_a_slow_camera_is_not_asked_for_raw_pixels_between_its_frames(system: System):
    system.after(0, "jpeg")
    assert system.after(8, "jpeg", "raw") == {"jpeg"}
    for _ in range(3):
        assert system.after(7.9) == {"jpeg"}
        assert system.after(0.1, "jpeg") == {"jpeg"}
    assert system.after(24) == {"jpeg", "raw"}, "three times the time between two"


def test_compressed_frames_are_taken_until_one_came_through_shared_memory(system: System):
    assert system.memory.started
    system.memory.offered = True
    assert system.after(1) == {"jpeg"}
    assert system.after(0.1, "jpeg") == {"jpeg"}
    assert system.after(0.1, "shm") == set()
    assert system.auto.keys == (COMPRESSED,)
    assert system.after(0.1, "jpeg", "shm") == set(), "one that was on its way"
    for _ in range(3):
        assert system.after(1, "shm") == set()


def test_they_are_taken_again_when_the_offer_goes_and_when_nothing_comes_for_3_s(system: System):
    system.memory.offered = True
    assert system.after(1, "shm") == set()
    system.memory.offered = False
    system.memory.notice(None)
    wait_until(lambda: system.routes["jpeg"].started)
    assert system.settled() == {"jpeg"}, "and no raw pixels, since it is not silent yet"
    system.memory.offered = True
    assert system.after(0.1, "shm") == set()
    assert system.after(2.9) == set()
    assert system.after(0.1) == {"jpeg", "raw"}


def test_a_frame_that_came_by_two_routes_switches_to_the_cheaper_one(system: System):
    """The network may be faster than the memory: what counts is that the memory delivers."""
    system.memory.offered = True
    assert system.after(0, "jpeg", "shm") == set()


def test_a_silent_route_waits_for_events_without_looking_again(system: System):
    system.after(3)
    looks = system.memory.looks
    system.clock.step(1000)
    system.routes["raw"].notice(sample(0, arrived_ns=system.clock.monotonic_ns()))
    wait_until(lambda: system.memory.looks == looks + 1)


def test_a_stopped_route_takes_nothing_and_is_not_started_again(system: System):
    system.auto.stop()
    system.routes["jpeg"].notice(sample(0))
    system.memory.notice(None)
    system.auto._follow()  # one that had begun before
    assert not any(route.started for route in system.routes.values())


def test_without_shared_memory_there_are_two_routes():
    compressed, raw = Plain(COMPRESSED), Plain(RAW)
    auto = AutoRoute([compressed, raw], SteppedClock())
    auto.start()
    assert (auto.keys, auto.fault) == ((COMPRESSED,), "")
    assert (compressed.started, raw.started) == (True, False)
    auto.stop()
