"""A node says which frames it waits for, once, and when they are there."""

from __future__ import annotations

import logging

import pytest

from tests.support.intakes import PIXELS, RAW_KEY, Taker, sample
from zenoh_vision.health.log_throttle import SilenceLog
from zenoh_vision.stream.intake import InputState

FRONT = "vision/front/image/compressed"
ANY = "vision/*/image/compressed"


class Watch:
    """A log of silence, and what it has said."""

    def __init__(self, caplog: pytest.LogCaptureFixture) -> None:
        caplog.set_level(logging.INFO)
        self._caplog = caplog
        self._log = SilenceLog(logging.getLogger("node"))

    def said(self, now_s: float, **since_s: float) -> list[str]:
        """Return what it says of inputs that last received so and so, at a time."""
        self._caplog.clear()
        states = [InputState(key, int(s * 1e9)) for key, s in since_s.items()]
        self._log.note(states, now_s)
        return self._caplog.messages


@pytest.fixture
def watch(caplog: pytest.LogCaptureFixture) -> Watch:
    return Watch(caplog)


def test_a_node_that_waits_for_its_camera_says_so_once(watch: Watch):
    assert watch.said(101, **{FRONT: 100}) == []
    assert watch.said(103, **{FRONT: 100}) == [f"waiting: no frame on {FRONT} for 2 s"]
    assert watch.said(104, **{FRONT: 100}) == []
    assert watch.said(105, **{FRONT: 104.5}) == [f"frames arrive on {FRONT}"]
    assert watch.said(106, **{FRONT: 105.5}) == []


def test_a_camera_of_one_frame_in_three_seconds_is_logged_once_a_minute(watch: Watch):
    lines = [line for s in range(120) for line in watch.said(s + 0.9, **{FRONT: s - s % 3})]
    assert len([line for line in lines if line.startswith("waiting")]) == 2


def test_inputs_of_all_cameras_say_when_the_first_sends(watch: Watch):
    assert watch.said(103, **{ANY: 100}) == [f"waiting: no frame on {ANY} for 2 s"]
    assert watch.said(104, **{FRONT: 103.9}) == [f"frames arrive on {ANY}"]


def test_a_camera_that_was_forgotten_is_not_said_to_be_back(watch: Watch):
    other = "vision/back/image/compressed"
    assert watch.said(103, **{FRONT: 100, other: 103}) == [f"waiting: no frame on {FRONT} for 2 s"]
    assert watch.said(163, **{other: 163}) == []


def test_many_that_fall_silent_are_one_line(watch: Watch):
    (line,) = watch.said(10, **{f"vision/c{n}/image": 1 for n in range(9)})
    assert line.endswith("c4/image and 4 more for 2 s")


def test_raw_frames_after_a_wait_for_compressed_ones_are_said_to_arrive(caplog):
    caplog.set_level(logging.INFO)
    log = SilenceLog(logging.getLogger("node"))
    intake = Taker().frames(FRONT)
    opened_s = intake.states()[0].since_ns / 1e9
    log.note(intake.states(), opened_s + 3)
    intake.receive(sample(0, PIXELS.tobytes(), RAW_KEY, arrived_ns=int((opened_s + 4) * 1e9)))
    log.note(intake.states(), opened_s + 5)
    assert caplog.messages == [
        f"waiting: no frame on {FRONT} for 2 s",
        f"frames arrive on {RAW_KEY}",
    ]
