"""Loops over a node's inputs: what is counted, what is closed, which parameters are active."""

from __future__ import annotations

import re
import time
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar

import pytest
from pydantic import Field

from tests.support.headers import header
from tests.support.library import LampSettings
from zenoh_vision.config.parameters import Live
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.health.latency import LatencyMonitor
from zenoh_vision.keys import Transport
from zenoh_vision.messages import Centroid
from zenoh_vision.node import frame_input
from zenoh_vision.node.node import Node
from zenoh_vision.stream.buffer import queue
from zenoh_vision.stream.sample import Sample

KEY = "vision/front/centroid"
CENTROID = Centroid(header=header(4), x=None, y=None, box=None, area=None)


class Link:
    """Subscriptions to which nothing comes by itself."""

    def __init__(self) -> None:
        self.subscriptions = 0

    def declare(self, declare: object) -> Any:
        self.subscriptions += 1
        return SimpleNamespace(undeclare=self._undeclare)

    def _undeclare(self) -> None:
        self.subscriptions -= 1


@pytest.fixture
def node() -> Node:
    """A node that was not started: the tests deliver to its intakes."""
    node = Node("taker", camera="front", parameters=LampSettings())
    node._link = Link()  # type: ignore[assignment]
    return node


def test_what_waits_when_a_loop_is_left_is_counted_as_unread(node: Node):
    samples = node.samples(KEY)
    for _ in range(3):
        samples.intake.receive(Sample(KEY, b"x"))
    for _ in samples:
        break
    assert node.counters.snapshot() == {
        "received": 3,
        "processed": 1,
        "dropped.unread": 2,
        "pending": 0,
    }


def test_what_waits_when_the_node_stops_stays_pending(node: Node):
    samples = node.samples(KEY)
    for _ in range(3):
        samples.intake.receive(Sample(KEY, b"x"))
    for _ in samples:
        node.stop()
    assert node.counters.snapshot() == {"received": 3, "processed": 1, "pending": 2}


def test_nothing_is_taken_from_another_input_once_the_node_stops(node: Node, monkeypatch):
    first, second = node.samples(KEY), node.samples(KEY)
    for each in (first, second):
        each.intake.receive(Sample(KEY, b"x"))
    taken: list[float] = []
    monkeypatch.setattr(second, "take", taken.append)
    for _ in node.receive(first, second):
        node.stop()
    assert taken == []


def test_a_loop_over_a_closed_input_is_an_error_that_says_what_to_do(node: Node):
    samples = node.samples(KEY)
    samples.intake.receive(Sample(KEY, b"x"))
    for _ in samples:
        break
    with pytest.raises(RuntimeError, match=f"{KEY} is closed.*open another"):
        next(iter(samples))
    node.stop()
    assert list(samples) == []


def test_closed_inputs_leave_nothing_behind_in_their_node(node: Node):
    for _ in range(3):
        samples = node.samples(KEY)
        samples.close()
        samples.close()
    kept = node.samples(KEY)
    assert node.inputs == {kept}
    assert node.health.inputs == [kept.intake]
    assert node.link.subscriptions == 1  # type: ignore[attr-defined]


def test_the_newest_parameters_are_active_in_a_loop_over_any_input(node: Node):
    assert node.parameters is not None
    messages, samples = node.messages("centroid"), node.samples(KEY)
    messages.intake.receive(Sample(KEY, CENTROID.to_bytes()))
    samples.intake.receive(Sample(KEY, b"x"))
    active = []
    for item in node.receive(messages, samples):
        node.parameters.change({"power": 10 + len(active)})
        active.append((type(item), node.parameters.active.number))
        if len(active) == 2:
            break
    assert active == [(Centroid, 0), (Sample, 1)]


def test_a_misspelt_topic_of_messages_is_an_error_that_lists_the_topics(node: Node):
    with pytest.raises(ValueError, match=r"no topic 'centriod'; known are .*centroid, tracks"):
        node.messages("centriod")
    assert node.messages("vision/*/centriod").intake.key == "vision/*/centriod"


def test_samples_count_for_the_rate_and_have_no_latency(node: Node):
    node.health.latency = LatencyMonitor(window_s=3600)
    samples = node.samples(KEY)
    for _ in range(3):
        samples.intake.receive(Sample(KEY, b"x"))
    for _ in samples:
        if not samples.intake.buffer.filled:
            break
    assert node.health.latency.rate_hz(time.monotonic() + 1.0) > 0
    assert node.health.diagnostics().latency_ms.p50 is None


class AgeSettings(LampSettings):
    env_prefix: ClassVar[str] = "ZV_AGE_"

    max_age: Annotated[float, Field(gt=0, description="how old")] = 0.2


@pytest.mark.parametrize(
    ("settings", "max_age_s", "used_s"),
    [
        pytest.param(LampSettings(), 0.5, 0.5, id="the argument"),
        pytest.param(AgeSettings(), 0.5, 0.2, id="the setting takes precedence"),
        pytest.param(AgeSettings(), None, None, id="none is too old, whatever the settings"),
    ],
)
def test_the_age_from_which_a_frame_is_stale(
    node: Node, monkeypatch, settings: LampSettings, max_age_s: float | None, used_s: float | None
):
    node.parameters = ParameterStore(settings)
    frames = node.frames(max_age_s=max_age_s)
    used = []
    monkeypatch.setattr(frames.intake, "take", lambda *arguments: used.append(arguments[-1]))
    assert frames.take(0.0) is None
    assert used == [used_s]


class TransportSettings(LampSettings):
    env_prefix: ClassVar[str] = "ZV_TRANSPORT_"

    transport: Annotated[Transport, Field(description="which key"), Live()] = "jpeg"


def test_shared_memory_that_this_process_cannot_use_is_refused_at_start_and_live(
    node: Node, monkeypatch
):
    node.parameters = ParameterStore(TransportSettings())
    monkeypatch.setattr(frame_input, "why_impossible", lambda: "no iceoryx2")
    node.frames()
    refused = pytest.raises(
        ParameterRefused, match="transport = shm: no iceoryx2; allowed: auto, raw, jpeg"
    )
    with refused:
        node.parameters.change({"transport": "shm"})
    assert node.parameters.newest.settings.transport == "jpeg"
    node.parameters.change({"transport": "raw"})
    node.parameters = None
    with refused:
        node.frames(transport="shm")


def test_a_transport_that_frames_of_all_cameras_do_not_have_is_refused_at_start_and_live(
    node: Node,
):
    node.parameters = ParameterStore(TransportSettings())
    node.frames(camera="*")
    for told in ("shm", "raw"):
        with pytest.raises(
            ParameterRefused, match=rf"{told}: .* all cameras .*allowed: auto, jpeg"
        ):
            node.parameters.change({"transport": told})
    node.parameters.change({"transport": "auto"})
    node.parameters = ParameterStore(TransportSettings(transport="shm"))
    with pytest.raises(ParameterRefused, match=r"transport = shm: .* name the cameras"):
        node.frames(camera="*")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"want": "grey"}, "want='grey'; allowed: pixels, bgr, gray, a function"),
        ({"transport": "tcp"}, "transport='tcp'; allowed: auto, shm, raw, jpeg"),
        ({"topic": "centroid"}, "centroid carries messages, not pictures; take node.messages"),
        ({"buffering": 5}, "buffering=5; allowed: latest, queue(n)"),
        ({"buffering": queue}, "allowed: latest, queue(n)"),
    ],
)
def test_a_wrong_argument_of_frames_is_refused_with_what_is_allowed(
    node: Node, wrong: dict[str, Any], said: str
):
    with pytest.raises((TypeError, ValueError), match=re.escape(said)):
        node.frames(**wrong)
    assert not node.inputs


def test_a_wrong_argument_of_messages_is_refused_with_what_is_allowed(node: Node):
    with pytest.raises(ValueError, match=r"image carries pictures, .* take node\.frames"):
        node.messages("image")
    with pytest.raises(TypeError, match=re.escape("buffering=5; allowed: latest, queue(n)")):
        node.messages("centroid", buffering=5)  # type: ignore[arg-type]


class OtherSettings(LampSettings):
    env_prefix: ClassVar[str] = "ZV_OTHER_"

    transport: Annotated[str, Field(description="of goods")] = "lorry"


def test_a_setting_of_another_meaning_is_no_transport(node: Node):
    node.parameters = ParameterStore(OtherSettings())
    assert node.frames(transport="raw").intake.keys == ("vision/front/image",)


def test_a_silent_input_of_pairs_follows_the_parameters(node: Node, monkeypatch):
    node.parameters = ParameterStore(TransportSettings())
    left = node.frames(transport="auto")
    right = node.messages("centroid")
    assert left.intake.keys == ("vision/front/image/compressed",)
    node.parameters.change({"transport": "raw"})
    rounds = iter(range(3))

    def end_after_three() -> None:
        if next(rounds, None) is None:
            node.stop()

    monkeypatch.setattr(node.health, "loop_alive", end_after_three)
    assert list(node.pairs(left, right, wait_s=0)) == []
    assert left.intake.keys == ("vision/front/image",)
