"""A node's own report, its rates and its complaints, as one level and message."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from common import health as health_module
from common.diagnostics import ERROR, OK, STALE, WARN
from common.errors import PayloadError
from common.health import Health
from common.ledger import Ledger


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
        self.ledger = Ledger("captured", "published")
        self.health = Health("camera_front", self.ledger)
        self._clock = clock

    def run(self, seconds: int, rate_hz: int, overwritten_hz: int = 0) -> tuple[int, str]:
        """Let time pass and return the last level and message."""
        for _ in range(seconds):
            for n in range(rate_hz):
                self.ledger.arrive()
                if n < overwritten_hz:
                    self.ledger.drop("overwritten")
                else:
                    self.ledger.finish()
            self._clock.now_s += 1.0
            said = self.health.diagnostics()
        return said.level, said.message


@dataclass
class Receiver:
    """What ``Health`` looks at of a receiver."""

    begun_s: float
    arrived_s: float | None = None
    late_since_s: float | None = None
    clock_offset_ns: int | None = None
    key: str = "vision/front/image/compressed"


@pytest.fixture
def camera(monkeypatch: pytest.MonkeyPatch) -> Camera:
    clock = Clock()
    monkeypatch.setattr(health_module, "time", clock)
    return Camera(clock)


def test_a_camera_at_its_rate_is_ok(camera: Camera):
    camera.health.bounds.expect(30.0)
    assert camera.run(20, 30) == (OK, "ok")


def test_a_camera_under_its_configured_rate_warns(camera: Camera):
    camera.health.bounds.expect(30.0)
    assert camera.run(20, 20) == (WARN, "20.0 Hz captured, under the 30 Hz configured")
    assert camera.run(20, 30) == (OK, "ok")


def test_a_node_slower_than_its_stream_warns(camera: Camera):
    assert camera.run(20, 30, overwritten_hz=15) == (
        WARN,
        "slower than its stream: 30.0 Hz captured, 15.0 Hz used",
    )


def test_while_a_source_is_lost_its_rate_is_not_judged_nor_right_after(camera: Camera):
    camera.health.bounds.expect(30.0)
    camera.run(10, 30)
    camera.health.report(ERROR, "the source ended")
    assert camera.run(30, 0) == (ERROR, "the source ended")
    camera.health.report(OK, "")
    assert camera.run(2, 30) == (OK, "ok")
    assert camera.run(20, 30) == (OK, "ok")


def test_all_that_is_wrong_is_said_and_the_worst_is_the_level(camera: Camera):
    camera.health.bounds.expect(30.0)
    camera.run(19, 20)
    camera.health.complain(PayloadError("corrupt", "a picture"))
    level, message = camera.run(1, 20)
    assert level == WARN
    assert message == ("20.0 Hz captured, under the 30 Hz configured; dropping samples: corrupt")


def test_the_histogram_counts_what_the_percentiles_have_forgotten(camera: Camera):
    camera.health.pace.note(100.0, 4.0)
    camera.run(60, 0)
    said = camera.health.diagnostics()
    assert said.latency_ms.p50 is None
    assert said.latency_histogram_ms is not None
    assert (said.latency_histogram_ms.counts[-1], said.latency_histogram_ms.sum) == (1, 4.0)


def test_a_key_is_silent_since_one_listens_to_it_and_not_since_the_node_began(camera: Camera):
    camera.run(3600, 0)
    receiver = Receiver(begun_s=3700.0)
    camera.health.receivers.append(receiver)  # type: ignore[arg-type]
    assert camera.run(2, 0) == (OK, "ok")
    assert camera.run(1, 0) == (STALE, f"no frame on {receiver.key} for 3 s")
    receiver.arrived_s = 3703.0
    assert camera.run(1, 0) == (OK, "ok")
    assert camera.run(5, 0) == (STALE, f"no frame on {receiver.key} for 6 s")
