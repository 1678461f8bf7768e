"""A node's own report, its rates and its complaints, as one level and message."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from zenoh_vision.errors import PayloadError
from zenoh_vision.health import health as health_module
from zenoh_vision.health.health import Health
from zenoh_vision.keys import Way
from zenoh_vision.messages import Level
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.intake import InputState


@dataclass
class Clock:
    now_s: float = 100.0

    def monotonic(self) -> float:
        return self.now_s

    def time_ns(self) -> int:
        return int(self.now_s * 1e9)


class Camera:
    """A camera's health, second by second."""

    def __init__(self, clock: Clock) -> None:
        self.counters = FrameCounters("captured", "published")
        self.health = Health("camera_front", self.counters)
        self._clock = clock

    def run(self, seconds: int, rate_hz: int, overwritten_hz: int = 0) -> tuple[int, str]:
        """Let time pass and return the last level and message."""
        for _ in range(seconds):
            for n in range(rate_hz):
                self.counters.arrive()
                if n < overwritten_hz:
                    self.counters.drop("overwritten")
                else:
                    self.counters.finish()
            self._clock.now_s += 1.0
            said = self.health.diagnostics()
        return said.level, said.message


@dataclass
class Input:
    """What ``Health`` looks at of an input with one key."""

    since_s: float
    key: str = "vision/front/image/compressed"
    way: Way | None = None
    fault: str = ""

    def states(self) -> list[InputState]:
        return [InputState(self.key, int(self.since_s * 1e9), way=self.way)]


@pytest.fixture
def camera(monkeypatch: pytest.MonkeyPatch) -> Camera:
    clock = Clock()
    monkeypatch.setattr(health_module, "time", clock)
    return Camera(clock)


def test_a_camera_at_its_rate_is_ok(camera: Camera):
    camera.health.rates.expect(30.0)
    assert camera.run(20, 30) == (Level.OK, "ok")


def test_a_camera_under_its_configured_rate_warns(camera: Camera):
    camera.health.rates.expect(30.0)
    assert camera.run(20, 20) == (Level.WARN, "20.0 Hz captured, under the 30 Hz configured")
    assert camera.run(20, 30) == (Level.OK, "ok")


def test_a_node_slower_than_its_stream_warns(camera: Camera):
    assert camera.run(20, 30, overwritten_hz=15) == (
        Level.WARN,
        "slower than its stream: 30.0 Hz captured, 15.0 Hz used",
    )


def test_while_a_source_is_lost_its_rate_is_not_judged_nor_right_after(camera: Camera):
    camera.health.rates.expect(30.0)
    camera.run(10, 30)
    camera.health.report(Level.ERROR, "the source ended")
    assert camera.run(30, 0) == (Level.ERROR, "the source ended")
    camera.health.report(Level.OK, "")
    assert camera.run(2, 30) == (Level.OK, "ok")
    assert camera.run(20, 30) == (Level.OK, "ok")


def test_all_that_is_wrong_is_said_and_the_worst_is_the_level(camera: Camera):
    camera.health.rates.expect(30.0)
    camera.run(19, 20)
    camera.health.log_drop(PayloadError("corrupt", "a picture"))
    level, message = camera.run(1, 20)
    assert level == Level.WARN
    assert message == ("20.0 Hz captured, under the 30 Hz configured; dropping samples: corrupt")


def test_the_histogram_counts_what_the_percentiles_have_forgotten(camera: Camera):
    camera.health.latency.note(100.0, 4.0)
    camera.run(60, 0)
    said = camera.health.diagnostics()
    assert said.latency_ms.p50 is None
    assert said.latency_histogram_ms is not None
    assert (said.latency_histogram_ms.counts[-1], said.latency_histogram_ms.sum) == (1, 4.0)


def test_a_key_is_silent_since_one_listens_to_it_and_not_since_the_node_began(camera: Camera):
    camera.run(3600, 0)
    watched = Input(since_s=3700.0)
    camera.health.watch(watched)
    assert camera.run(2, 0) == (Level.OK, "ok")
    assert camera.run(1, 0) == (Level.STALE, f"no frame on {watched.key} for 3 s")
    watched.since_s = 3703.0
    assert camera.run(1, 0) == (Level.OK, "ok")
    assert camera.run(5, 0) == (Level.STALE, f"no frame on {watched.key} for 6 s")


def test_the_ways_of_all_inputs_are_said_once_each(camera: Camera):
    assert camera.health.diagnostics().transport is None
    for way in (None, "shm", "jpeg", "shm"):
        camera.health.watch(Input(since_s=100.0, way=way))
    assert camera.health.diagnostics().transport == "jpeg,shm"


def test_that_shared_memory_fails_is_a_warning(camera: Camera):
    camera.health.shared_memory = "no room"
    assert camera.run(1, 0) == (Level.WARN, "no room")


def test_what_keeps_frames_from_coming_the_way_they_should_is_a_warning(camera: Camera):
    watched = Input(since_s=100.0, fault="no frames of front through shared memory: full")
    camera.health.watch(watched)
    assert camera.run(1, 0) == (Level.WARN, "no frames of front through shared memory: full")
    watched.fault = ""
    assert camera.run(1, 0) == (Level.OK, "ok")


def test_a_remark_is_said_without_a_level_of_its_own():
    health = Health("camera_front", FrameCounters("captured", "published"))
    health.remark = "max_kbps = 800: fewer frames"
    said = health.diagnostics()
    assert (said.level, said.message) == (Level.OK, "max_kbps = 800: fewer frames")
    health.remark = ""
    assert health.diagnostics().message == "ok"
