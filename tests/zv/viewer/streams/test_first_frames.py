"""The first frame of a run: decoded on another thread, and before those that follow."""

import asyncio
import threading
from types import SimpleNamespace

from tests.support.viewer.picture_streams import balance
from tests.support.waiting import DEADLINE_S
from zv.viewer.streams.rendering import RenderOptions


async def test_the_first_frame_of_a_run_is_decoded_elsewhere_and_before_those_that_follow(
    registry, source
):
    feed = source.stream.feed(RenderOptions())
    feed.want()
    source.believe.clear()
    source.comes(unverified=True)
    for _ in range(4):
        source.comes()
    assert await feed.next(0.1) is None  # the loop goes round meanwhile
    assert balance(registry)["dropped.overwritten"] == 3
    source.believe.set()
    newest = await feed.next(DEADLINE_S)
    assert newest is not None
    assert newest.header.seq == 5
    (first, elsewhere), (second, here) = source.accepted
    assert (first, second) == (1, 5)
    assert elsewhere != here == threading.current_thread().name
    counters = balance(registry)
    assert (counters["processed"], counters["dropped.overwritten"]) == (1, 4)


async def test_a_first_frame_that_is_decoded_after_all_have_left_was_for_nobody(registry, source):
    feed = source.stream.feed(RenderOptions())
    source.believe.clear()
    source.comes(unverified=True)
    feed.close()
    source.believe.set()
    while balance(registry)["pending"]:
        await asyncio.sleep(0.01)
    assert balance(registry)["dropped.unwatched"] == 1


async def test_memory_is_not_given_back_while_the_first_frame_of_a_run_is_decoded(registry, source):
    feed = source.stream.feed(RenderOptions())
    source.stream._subscription = SimpleNamespace(undeclare=lambda: None)  # type: ignore[assignment]
    registry.context.health.watch(source)  # type: ignore[arg-type]
    source.believe.clear()
    source.comes(unverified=True)
    feed.close()
    source.stream._unsubscribe()
    assert not source.closed
    source.believe.set()
    while not source.closed:
        await asyncio.sleep(0.01)


async def test_a_first_frame_that_fails_as_none_should_does_not_hold_up_the_next(registry, source):
    feed = source.stream.feed(RenderOptions())
    feed.want()
    source.comes(b"unforeseen", unverified=True)
    source.comes(unverified=True)
    picture = await feed.next(DEADLINE_S)
    assert picture is not None
    assert picture.header.seq == 2
    counters = balance(registry)
    assert (counters["processed"], counters["dropped.not_rendered"]) == (1, 1)


async def test_an_unverified_frame_that_waits_behind_a_frame_is_taken_without_another_to_come(
    source,
):
    source.stream.feed(RenderOptions()).want()
    taken, source.stream._on_arrival = source.stream._on_arrival, lambda: None  # type: ignore[method-assign]
    source.comes(unverified=True)
    source.comes()
    source.stream._on_arrival = taken  # type: ignore[method-assign]
    source.stream._on_arrival()
    while len(source.accepted) < 2:  # the deadline is run's
        await asyncio.sleep(0.01)
    assert [number for number, _ in source.accepted] == [2, 1]
