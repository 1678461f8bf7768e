"""Loops over a node's inputs: what is counted, what is closed, which parameters are active."""

from __future__ import annotations

import math
import re
import threading
import time
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar

import numpy as np
import pytest
from pydantic import Field

from tests.support.clocks import SteppedClock
from tests.support.headers import header
from tests.support.intakes import JPEG, sample
from tests.support.library import LampSettings
from tests.support.waiting import DEADLINE_S, wait_until
from zenoh_vision.config.consumer_options import FrameTransport, MaxAge
from zenoh_vision.errors import ParameterRefused, PayloadError
from zenoh_vision.health.latency import LatencyMonitor
from zenoh_vision.keys import Transport
from zenoh_vision.messages import Centroid, Tracks
from zenoh_vision.node import frame_input, inputs
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
    return taker(LampSettings())


def taker(settings: LampSettings | None) -> Node:
    """Return a node that was not started: the tests deliver to its intakes."""
    node = Node("taker", camera="front", parameters=settings)
    node._core.opened_link = Link()  # type: ignore[assignment]
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


def test_an_item_that_its_loop_drops_does_not_count_as_processed_too(node: Node):
    samples = node.samples(KEY)
    node.counters.arrive()
    node.drop(PayloadError("earlier", "of no loop"))
    for _ in range(3):
        samples.intake.receive(Sample(KEY, b"x"))
    for number, _ in enumerate(samples):
        if number == 1:
            node.drop(PayloadError("too_dark", "a mean of 3"))
        if number == 2:
            break
    counted = {"received": 4, "processed": 2, "dropped.earlier": 1, "dropped.too_dark": 1}
    assert node.health.diagnostics().counters == {**counted, "pending": 0}


def test_an_item_of_a_pair_that_its_loop_drops_does_not_count_as_processed_too(node: Node):
    first, second = node.messages("centroid"), node.messages("tracks")
    first.intake.receive(Sample(KEY, CENTROID.to_bytes()))
    second.intake.receive(Sample(KEY, Tracks(header=CENTROID.header, tracks=()).to_bytes()))
    for _ in node.pairs(first, second):
        node.drop(PayloadError("too_dark", "a mean of 3"))
        break
    counted = {"received": 2, "processed": 1, "dropped.too_dark": 1}
    assert node.health.diagnostics().counters == {**counted, "pending": 0}


@pytest.mark.parametrize("in_pairs", [False, True])
def test_padding_of_a_picture_is_counted_alone_and_in_pairs(node: Node, in_pairs: bool):
    frames, centroids = node.frames(transport="jpeg", max_age_s=None), node.messages("centroid")
    frames.intake.receive(sample(4, JPEG[:-2] + bytes(9) + JPEG[-2:]))
    centroids.intake.receive(Sample(KEY, CENTROID.to_bytes()))
    for _ in node.pairs(frames, centroids) if in_pairs else frames:
        break
    assert node.counters.snapshot()["padded"] == 1


def test_the_latency_of_a_replayed_pair_counts_from_the_replay(node: Node):
    now_ns = time.time_ns()
    first, second = node.messages("centroid"), node.messages("tracks")
    replayed = header(stamp_ns=now_ns - 10**15, replay=now_ns, replayed_ns=now_ns)
    first.intake.receive(Sample(KEY, CENTROID.model_copy(update={"header": replayed}).to_bytes()))
    second.intake.receive(Sample(KEY, Tracks(header=replayed, tracks=()).to_bytes()))
    for _ in node.pairs(first, second):
        break
    assert node.health.diagnostics().latency_ms.p99 < DEADLINE_S * 1000


def test_a_loop_with_an_interval_wakes_in_it_whether_items_arrive_or_not(node: Node):
    samples = node.samples(KEY)
    begun_s, woken_s = time.monotonic(), []
    for item in node.receive(samples, every_s=0.2):
        if item is None:
            woken_s.append(time.monotonic() - begun_s)
            if len(woken_s) == 2:
                samples.intake.receive(Sample(KEY, b"x"))  # the next interval begins with an item
            if len(woken_s) == 4:
                break
    waits = np.diff([0.0, *woken_s])
    assert min(waits) >= 0.2
    assert node.counters.snapshot()["processed"] == 1


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
    assert node.health.inputs == [kept]
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

    how_old: MaxAge = 0.2
    max_age: Annotated[float, Field(gt=0, description="of a cheese")] = 3.0


@pytest.mark.parametrize(
    ("settings", "max_age_s", "used_s"),
    [
        pytest.param(LampSettings(), 0.5, 0.5, id="the argument"),
        pytest.param(AgeSettings(), 0.5, 0.2, id="the setting of the type MaxAge, not by name"),
        pytest.param(AgeSettings(), None, None, id="none is too old, whatever the settings"),
    ],
)
def test_the_age_from_which_a_frame_is_stale(
    monkeypatch, settings: LampSettings, max_age_s: float | None, used_s: float | None
):
    frames = taker(settings).frames(max_age_s=max_age_s)
    used = []
    monkeypatch.setattr(frames.intake, "accept", lambda *arguments: used.append(arguments[1]))
    frames.intake.receive(sample(0))
    assert frames.take(0.0) is None
    assert used == [used_s]


class TransportSettings(LampSettings):
    env_prefix: ClassVar[str] = "ZV_TRANSPORT_"

    transport: FrameTransport = "jpeg"


def test_shared_memory_that_this_process_cannot_use_is_refused_at_start_and_live(
    monkeypatch,
):
    monkeypatch.setattr(frame_input, "why_impossible", lambda: "no iceoryx2")
    node = taker(TransportSettings())
    node.frames()
    refused = pytest.raises(
        ParameterRefused, match="transport = shm: no iceoryx2; allowed: auto, raw, jpeg"
    )
    with refused:
        node.parameters.change({"transport": "shm"})
    assert node.parameters.newest.settings.transport == "jpeg"
    node.parameters.change({"transport": "raw"})
    with refused:
        taker(None).frames(transport="shm")


def test_a_transport_that_frames_of_all_cameras_do_not_have_is_refused_at_start_and_live():
    node = taker(TransportSettings())
    node.frames(camera="*")
    for told in ("shm", "raw"):
        with pytest.raises(
            ParameterRefused, match=rf"{told}: .* all cameras .*allowed: auto, jpeg"
        ):
            node.parameters.change({"transport": told})
    node.parameters.change({"transport": "auto"})
    with pytest.raises(ParameterRefused, match=r"transport = shm: .* name the cameras"):
        taker(TransportSettings(transport="shm")).frames(camera="*")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"want": "grey"}, "want='grey'; allowed: pixels, bgr, gray, a function"),
        ({"transport": "tcp"}, "transport='tcp'; allowed: auto, shm, raw, jpeg"),
        ({"topic": "centroid"}, "centroid carries messages, not pictures; take node.messages"),
        ({"buffering": 5}, "buffering=5; allowed: latest, queue(n)"),
        ({"buffering": queue}, "allowed: latest, queue(n)"),
        ({"max_age_s": 0}, "max_age_s=0; allowed: above 0"),
        ({"max_age_s": float("nan")}, "max_age_s=nan; allowed: above 0"),
        ({"max_pixels": -1}, "max_pixels=-1; allowed: above 0"),
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


@pytest.mark.parametrize("rate_hz", [0, -1, float("inf"), float("nan")])
def test_an_expected_rate_that_is_none_is_refused(node: Node, rate_hz: float):
    """The node's description, which has it, would be invalid, and the node not be found."""
    with pytest.raises(ValueError, match="it must be above 0 and finite"):
        node.expect_rate(rate_hz)


class OtherSettings(LampSettings):
    env_prefix: ClassVar[str] = "ZV_OTHER_"

    transport: Annotated[str, Field(description="of goods")] = "lorry"


def test_a_setting_of_another_meaning_is_no_transport():
    assert taker(OtherSettings()).frames(transport="raw").keys == ("vision/front/image",)


def test_an_input_that_nobody_reads_follows_the_parameters():
    node = taker(TransportSettings())
    frames = node.frames(transport="auto")
    assert frames.keys == ("vision/front/image/compressed",)
    assert [state.key for state in frames.states()] == ["vision/front/image/compressed"]
    assert node.parameters is not None
    node.parameters.change({"transport": "raw"})
    assert frames.keys == ("vision/front/image",)
    assert node.link.subscriptions == 1  # type: ignore[attr-defined]


@pytest.mark.parametrize("transport", ["auto", "jpeg", "raw"])
def test_a_closed_input_follows_nothing_more(transport: Transport):
    node = taker(TransportSettings(transport=transport))
    frames = node.frames()
    frames.close()
    assert node.link.subscriptions == 0  # type: ignore[attr-defined]
    assert node.parameters is not None
    node.parameters.change({"transport": "raw" if transport == "jpeg" else "jpeg"})
    assert frames.take(0.0) is None
    assert node.link.subscriptions == 0  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "loop",
    [
        lambda node, samples: samples,
        lambda node, samples: node.arrivals(samples, is_due=lambda: False),
    ],
    ids=["items", "arrivals"],
)
def test_a_loop_that_waits_ends_at_once_when_the_node_is_told_to_stop(
    node: Node, monkeypatch, loop
):
    monkeypatch.setattr(inputs, "POLL_S", 60.0)
    waiting = threading.Thread(target=lambda: list(loop(node, node.samples(KEY))), daemon=True)
    waiting.start()
    wait_until(lambda: waiting.ident in node._core.consumer.filled._asleep)
    node.stop()
    waiting.join(20)
    assert not waiting.is_alive()


def test_an_input_that_is_closed_in_its_own_loop_ends_it(node: Node):
    samples = node.samples(KEY)
    for _ in range(3):
        samples.intake.receive(Sample(KEY, b"x"))
    seen = 0
    for _ in samples:
        seen += 1
        samples.close()
    assert (seen, node.link.subscriptions) == (1, 0)  # type: ignore[attr-defined]
    assert node.counters.snapshot()["dropped.unread"] == 2


def test_a_loop_over_two_inputs_goes_on_with_the_one_that_is_open(node: Node):
    first, second = node.samples(KEY), node.samples("vision/front/other")
    first.intake.receive(Sample(KEY, b"x"))
    seen = []
    for item in node.receive(first, second):
        seen.append(item.key)
        if item.key == KEY:
            first.close()
            second.intake.receive(Sample("vision/front/other", b"x"))
        else:
            second.close()
    assert seen == [KEY, "vision/front/other"]


def test_a_function_that_decodes_finds_the_revision_of_its_frame():
    node = taker(LampSettings())
    found = []
    frames = node.frames(want=lambda frame: found.append(frame.revision.number), transport="jpeg")
    frames.intake.receive(sample(0))
    assert node.parameters is not None
    node.parameters.change({"power": 1})
    for frame in frames:
        found.append(frame.revision.number)
        break
    assert found == [1, 1]


@pytest.fixture
def clock() -> SteppedClock:
    return SteppedClock()


def test_it_yields_so_many_times_a_second_however_long_the_work_takes(clock: SteppedClock):
    node = Node("worker", clock=clock)
    times = []
    for number in node.rate(4):
        times.append((number, clock.now_ns / 1e9 - 100))
        clock.step(0.125)
        if number == 4:
            break
    assert times == [(n, n / 4) for n in range(5)]


def test_what_took_too_long_is_not_made_up_for(clock: SteppedClock):
    node = Node("worker", clock=clock)
    times = []
    for number in node.rate(2):
        times.append(clock.now_ns / 1e9 - 100)
        clock.step(2.0 if number == 0 else 0.0)
        if number == 3:
            break
    assert times == [0.0, 2.0, 2.5, 3.0]


def test_it_ends_when_the_node_is_told_to_stop_while_it_waits(clock: SteppedClock, monkeypatch):
    node = Node("worker", clock=clock)
    monkeypatch.setattr(clock, "sleep", lambda _: node.stop())
    assert list(node.rate(0.001)) == [0]


def test_the_newest_parameters_are_active_in_each_turn(clock: SteppedClock):
    node = Node("worker", clock=clock, parameters=LampSettings())
    assert node.parameters is not None
    found = []
    for number in node.rate(10):
        found.append(node.parameters.active.settings.power)
        node.parameters.change({"power": number})
        if number == 2:
            break
    assert found == [50, 0, 1]


@pytest.mark.parametrize("rate_hz", [0, -1, math.nan, math.inf])
def test_a_rate_is_above_0_and_finite(rate_hz: float):
    with pytest.raises(ValueError, match="must be above 0 and finite"):
        next(Node("worker").rate(rate_hz))
