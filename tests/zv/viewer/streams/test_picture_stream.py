"""Fan-out of one stream: newest only, each form at most once a frame, nothing for nobody."""

import asyncio
import threading
import time
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from tests.support.viewer.picture_streams import JPEG, KEY, SMALL, balance
from tests.support.waiting import DEADLINE_S
from zenoh_vision.image.frame import Frame
from zenoh_vision.stream.intake import Consumer
from zenoh_vision.stream.sample import Sample
from zv.viewer.settings import ViewerSettings
from zv.viewer.streams import picture_stream
from zv.viewer.streams.picture_stream import PictureStream
from zv.viewer.streams.rendering import RenderOptions


@pytest.fixture
def rendered(monkeypatch) -> list[int]:
    """The numbers of the frames that were rendered, as it happens."""
    found: list[int] = []
    real = picture_stream.render

    def render(frame: Frame, options: RenderOptions, quality: int, finder: object) -> Any:
        found.append(frame.header.seq)
        return real(frame, options, quality)

    monkeypatch.setattr(picture_stream, "render", render)
    return found


async def test_the_original_bytes_are_handed_on_to_every_client(rendered, registry, source):
    feeds = [source.stream.feed(RenderOptions()) for _ in range(20)]
    waiting = [asyncio.ensure_future(feed.next(DEADLINE_S)) for feed in feeds]
    await asyncio.sleep(0)
    source.comes()
    found = await asyncio.gather(*waiting)
    assert all(picture is found[0] for picture in found)
    assert found[0] is not None
    assert found[0].payload is JPEG
    assert rendered == []
    assert balance(registry)["processed"] == 1


async def test_one_form_is_made_once_a_frame_for_twenty_clients(rendered, source):
    feeds = [source.stream.feed(SMALL) for _ in range(20)]
    for _ in range(3):
        waiting = [asyncio.ensure_future(feed.next(DEADLINE_S)) for feed in feeds]
        await asyncio.sleep(0)
        source.comes()
        found = await asyncio.gather(*waiting)
        assert {(each.width, each.height, each.header.seq) for each in found if each} == {
            (32, 24, source.number)
        }
    assert rendered == [1, 2, 3]


async def test_nothing_is_made_while_no_client_is_ready(rendered, registry, source):
    feed = source.stream.feed(SMALL)
    for _ in range(50):
        source.comes()
    picture = await feed.next(DEADLINE_S)
    assert picture is not None
    assert picture.header.seq == 50
    assert rendered == [50]
    counters = balance(registry)
    assert (counters["processed"], counters["dropped.unready"]) == (1, 49)


async def test_a_client_that_is_slow_gets_the_newest_and_what_it_missed_is_counted(
    rendered, source
):
    feed = source.stream.feed(RenderOptions())
    source.comes()
    first = await feed.next(DEADLINE_S)
    for _ in range(4):
        source.comes(missed=2)
    second = await feed.next(DEADLINE_S)
    assert first is not None
    assert second is not None
    assert (first.header.seq, second.header.seq) == (1, 5)
    assert feed.skipped == 3  # 2, 3 and 4
    assert feed.lost == 2
    assert await feed.next(0.05) is None  # none twice


async def test_a_frame_that_waits_for_a_thread_gives_way_to_the_newest(rendered, registry, source):
    free = threading.Event()
    busy = [registry.pool.submit(free.wait, DEADLINE_S) for _ in range(2)]
    feed = source.stream.feed(SMALL)
    waiting = asyncio.ensure_future(feed.next(DEADLINE_S))
    await asyncio.sleep(0)
    for _ in range(3):
        source.comes()
    free.set()
    picture = await waiting
    assert all(work.result() for work in busy)
    assert picture is not None
    assert (picture.number, rendered) == (3, [3])
    feed.close()
    counters = balance(registry)
    assert (counters["processed"], counters["dropped.overwritten"]) == (1, 2)


async def test_while_one_frame_is_made_the_next_ones_replace_one_another(
    rendered, monkeypatch, source
):
    feed = source.stream.feed(SMALL)
    feed.want()
    for _ in range(30):  # the renderer's thread has no chance to be asked 30 times
        source.comes()
    seen = []
    while not seen or seen[-1] != 30:
        picture = await feed.next(DEADLINE_S)
        assert picture is not None
        seen.append(picture.header.seq)
    assert seen == sorted(set(seen))
    assert len(rendered) <= 3


async def test_a_new_client_gets_the_newest_picture_at_once_unless_the_stream_has_ended(
    monkeypatch, source
):
    source.stream.feed(RenderOptions()).want()
    source.comes()
    picture = await source.stream.feed(RenderOptions()).next(DEADLINE_S)
    assert picture is not None
    monkeypatch.setattr(picture_stream, "SILENT_S", 0.0)
    await asyncio.sleep(0.01)
    assert source.stream.ended_ns is not None
    assert await source.stream.feed(RenderOptions()).next(0.05) is None


@pytest.mark.parametrize("steps_s", [(0, 0.1, 0.1, 60, 0.1, 0.1), (0, 60, 0.1), (0, 0.1, 60)])
async def test_a_gap_behind_which_the_camera_came_back_does_not_make_the_next_one_usual(
    monkeypatch, steps_s, source
):
    now_s = 1000.0
    monkeypatch.setattr(picture_stream.time, "monotonic", lambda: now_s)

    source.stream.feed(RenderOptions()).want()
    for step_s in steps_s:
        now_s += step_s
        source.comes()
    now_s += 0.9
    assert source.stream.ended_ns is None
    now_s += 0.2
    assert source.stream.ended_ns is not None


async def test_a_picture_that_cannot_be_decoded_is_dropped_and_the_next_is_shown(
    rendered, registry, source
):
    feed = source.stream.feed(SMALL)
    feed.want()
    source.comes(JPEG[:-30])
    assert await feed.next(0.3) is None
    source.comes()
    picture = await feed.next(DEADLINE_S)
    assert picture is not None
    assert picture.header.seq == 2
    counters = balance(registry)
    assert (counters["processed"], counters["dropped.corrupt"]) == (1, 1)


class HeldUp:
    """A renderer that waits for each frame until the test lets it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.began = threading.Event()
        self._go = threading.Semaphore(0)
        self._real = picture_stream.render
        monkeypatch.setattr(picture_stream, "render", self._render)

    def _render(self, frame: Frame, options: RenderOptions, quality: int, finder: object) -> Any:
        self.began.set()
        assert self._go.acquire(timeout=DEADLINE_S)
        return self._real(frame, options, quality)

    def let(self, frames: int = 1) -> None:
        self._go.release(frames)


async def test_a_frame_that_was_given_after_the_next_had_come_is_the_one_that_counts(
    monkeypatch, registry, source
):
    renderer = HeldUp(monkeypatch)

    feed = source.stream.feed(SMALL)
    feed.want()
    source.comes()
    assert renderer.began.wait(DEADLINE_S)
    for _ in range(3):
        source.comes()  # while the first is being made
    assert balance(registry)["pending"] == 2  # the first and the newest
    renderer.let()
    first = await feed.next(DEADLINE_S)
    assert first is not None
    assert first.header.seq == 1
    counters = balance(registry)
    assert (counters["processed"], counters["dropped.overwritten"]) == (1, 2)
    assert counters["pending"] == 1  # the newest: nobody has got it
    renderer.let()
    last = await feed.next(DEADLINE_S)
    assert last is not None
    assert last.header.seq == 4
    counters = balance(registry)
    assert (counters["processed"], counters["pending"]) == (2, 0)


async def test_a_frame_that_several_clients_get_late_and_in_several_forms_counts_once(
    monkeypatch, registry, source
):
    renderer = HeldUp(monkeypatch)

    original, small = source.stream.feed(RenderOptions()), source.stream.feed(SMALL)
    small.want()
    source.comes()
    assert (await original.next(DEADLINE_S)) is not None
    assert renderer.began.wait(DEADLINE_S)
    source.comes()
    renderer.let()
    assert (await small.next(DEADLINE_S)) is not None
    counters = balance(registry)
    assert (counters["processed"], counters["pending"]) == (1, 1)
    small.close()
    renderer.let(9)


async def test_what_was_made_and_not_taken_is_dropped_when_its_form_is_wanted_no_more(
    monkeypatch, registry, source
):
    source.stream.feed(RenderOptions())
    small = source.stream.feed(SMALL)
    small.want()
    source.comes()
    while source.stream.newest is None or not small.waiting:
        await asyncio.sleep(0.01)
    source.comes()
    assert balance(registry)["pending"] == 2
    small.close()
    counters = balance(registry)
    assert (counters["dropped.unready"], counters["pending"]) == (1, 1)


async def test_a_stream_is_watched_and_silent_from_when_it_can_subscribe(registry):
    health, stream = registry.context.health, PictureStream(registry.context, KEY, print)

    def fail(_declare: object) -> None:
        raise zenoh.ZError("no link")

    with pytest.raises(zenoh.ZError):
        stream._subscribe(SimpleNamespace(declare=fail))  # type: ignore[arg-type]
    assert health.inputs == []
    begun_ns = time.monotonic_ns()
    subscription = SimpleNamespace(undeclare=lambda: None)
    stream._subscribe(SimpleNamespace(declare=lambda _: subscription))  # type: ignore[arg-type]
    (watched,) = health.inputs
    (state,) = watched.states()
    assert state.key == KEY
    assert begun_ns <= state.since_ns <= time.monotonic_ns()
    stream.close()
    stream._unsubscribe()
    assert health.inputs == []


async def test_the_last_clients_leave_ends_the_stream(registry, source):
    feeds = [source.stream.feed(options) for options in (RenderOptions(), RenderOptions(), SMALL)]
    source.comes()
    for feed in feeds[:-1]:
        feed.close()
        assert not registry.closed
    feeds[-1].close()
    assert registry.closed == [KEY]
    assert balance(registry)["dropped.unwatched"] == 1


def test_a_picture_over_the_limit_is_dropped_before_it_is_decoded(registry):
    most = ViewerSettings(max_pixels=64 * 48 - 1)
    context = replace(registry.context, settings=lambda: most)
    intake = PictureStream(context, KEY, registry.closed.append)._new_intake(
        Consumer(registry.counters, lambda _: None)
    )
    intake.receive(Sample(KEY, JPEG))
    assert registry.counters.snapshot()["dropped.too_large"] == 1
