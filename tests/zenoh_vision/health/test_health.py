"""A node's own report, its rates and its complaints, as one level and message."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from tests.support.clocks import SteppedClock
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.health import MOST_FINDINGS, Health
from zenoh_vision.health.message_limits import check
from zenoh_vision.keys import RouteName
from zenoh_vision.messages import Level
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.intake import InputState


class Camera:
    """A camera's health, second by second."""

    def __init__(self, clock: SteppedClock) -> None:
        self.counters = FrameCounters("captured", "published")
        self.health = Health("camera_front", self.counters, clock)
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
            self._clock.step(1)
            said = self.health.diagnostics()
        return said.level, said.message


@dataclass
class Input:
    """What ``Health`` looks at of an input with one key."""

    since_s: float
    key: str = "vision/front/image/compressed"
    route: RouteName | None = None
    fault: str = ""

    def states(self) -> list[InputState]:
        return [InputState(self.key, int(self.since_s * 1e9), route=self.route)]


@pytest.fixture
def camera() -> Camera:
    return Camera(SteppedClock(100 * 10**9, 100 * 10**9))


def test_a_camera_under_its_configured_rate_warns(camera: Camera):
    camera.health.rates.expect(30.0)
    assert camera.run(20, 30) == (Level.OK, "ok")
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
    camera.health.report("source", Level.ERROR, "the source ended")
    assert camera.run(30, 0) == (Level.ERROR, "the source ended")
    camera.health.report("source", Level.OK)
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


def test_the_route_of_each_input_is_said(camera: Camera):
    assert camera.health.diagnostics().routes is None
    for key, route in (("a", None), ("b", "shm"), ("c", "jpeg")):
        camera.health.watch(Input(since_s=100.0, key=key, route=route))
    assert camera.health.diagnostics().routes == {"b": "shm", "c": "jpeg"}


@pytest.mark.parametrize("silent_s", [0, 10])
def test_the_report_of_an_input_with_a_thousand_cameras_is_not_too_large(
    camera: Camera, silent_s: int
):
    names = [f"{'vision' * 10}/{number:064}/image/compressed" for number in range(1000)]
    states = [InputState(name, 100 * 10**9, offset_ns=10**15, route="jpeg") for name in names]
    camera.health.watch(SimpleNamespace(keys=(), fault="", states=lambda: states))
    camera._clock.step(silent_s)
    said = camera.health.diagnostics()
    check(said.node, said)
    assert said.level == (Level.STALE if silent_s else Level.OK)
    more = 2000 - MOST_FINDINGS if silent_s else 1000 - MOST_FINDINGS
    assert said.message.endswith(f"; and {more} more of its inputs")
    assert ("no frame on" in said.message) == bool(silent_s)


def test_the_lag_of_a_source_is_said_while_the_camera_knows_it(camera: Camera):
    assert "source_lag_ms" not in camera.health.diagnostics().to_map()
    camera.health.source_lag_ms = lambda: 41.5
    assert camera.health.diagnostics().to_map()["source_lag_ms"] == 41.5


def test_what_would_end_the_thread_that_reports_is_refused_or_becomes_text(camera: Camera):
    with pytest.raises(ValueError, match="99 is not a valid Level"):
        camera.health.report("lens", 99, "dirty")
    camera.health.report("lens", Level.WARN, ValueError("dirty"))  # type: ignore[arg-type]
    assert camera.run(1, 0) == (Level.WARN, "dirty")


def test_conditions_end_one_by_one_and_leave_the_others_as_they_are(camera: Camera):
    health = camera.health
    health.report("source", Level.ERROR, "the source ended")
    health.report("calibration", Level.WARN, "no camera_info")
    assert camera.run(1, 0) == (Level.ERROR, "no camera_info; the source ended")
    health.report("source", Level.OK)
    assert camera.run(1, 0) == (Level.WARN, "no camera_info"), "pictures are back, no calibration"
    health.report("source", Level.ERROR, "the source ended")
    health.report("calibration", Level.OK)
    assert camera.run(1, 0) == (Level.ERROR, "the source ended")
    assert (health.message("source"), health.message("calibration")) == ("the source ended", "")


def test_all_errors_are_failures_and_warnings_are_not(camera: Camera):
    for name, level in (("b", Level.ERROR), ("c", Level.WARN), ("a", Level.ERROR)):
        camera.health.report(name, level, f"{name} is wrong")
    assert camera.health.failure() == "a is wrong; b is wrong"


def test_a_warning_hides_no_low_rate(camera: Camera):
    camera.health.rates.expect(30.0)
    camera.health.report("calibration", Level.WARN, "no camera_info")
    said = "no camera_info; 20.0 Hz captured, under the 30 Hz configured"
    assert camera.run(20, 20) == (Level.WARN, said)


def test_what_keeps_frames_from_coming_the_way_they_should_is_a_warning(camera: Camera):
    watched = Input(since_s=100.0, fault="no frames of front through shared memory: full")
    camera.health.watch(watched)
    assert camera.run(1, 0) == (Level.WARN, "no frames of front through shared memory: full")
    watched.fault = ""
    assert camera.run(1, 0) == (Level.OK, "ok")


def test_a_remark_has_a_message_and_no_level_of_its_own(camera: Camera):
    said = ["max_kbps = 800: fewer frames"]
    camera.health.remarks["bandwidth"] = lambda: said[0]
    assert camera.run(1, 0) == (Level.OK, "max_kbps = 800: fewer frames")
    camera.health.report("source", Level.WARN, "the source ended")
    assert camera.run(1, 0) == (Level.WARN, "max_kbps = 800: fewer frames; the source ended")
    assert camera.health.failure() == ""
    said[0] = ""
    camera.health.report("source", Level.OK)
    assert camera.run(1, 0) == (Level.OK, "ok")


def test_one_silent_input_of_several_is_no_reason_to_call_the_node_stale(camera: Camera):
    silent, alive = Input(since_s=100.0, key="a"), Input(since_s=100.0, key="b")
    for each in (silent, alive):
        camera.health.watch(each)
    camera.run(4, 0)
    alive.since_s = 104.0
    assert camera.run(1, 0) == (Level.WARN, "no frame on a for 5 s")
    assert camera.run(3, 0) == (Level.STALE, "no frame on a for 8 s; no frame on b for 4 s")
