"""Fan-out of one stream: newest only, each form at most once a frame, nothing for nobody."""

import asyncio
import threading
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from common import images
from common.frame import Frame
from common.health import Health
from common.ledger import Ledger
from common.messages import Header
from common.receiving import Arrival
from common.slot import Slot
from services.viewer import pictures, renditions
from services.viewer.pictures import Pictures
from services.viewer.rendering import Form

KEY = "vision/front/image/compressed"
JPEG = images.encode_jpeg(np.zeros((48, 64, 3), np.uint8), "bgr8", 80)
SMALL = Form(32, 24)


class Hub:
    """What ``Pictures`` needs of the hub, with a renderer that counts and can be held up."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.loop = loop
        self.ledger = Ledger()
        self.health = Health("viewer", self.ledger)
        self.pool = ThreadPoolExecutor(2)
        self.network = SimpleNamespace(do=lambda work: None)
        self.forgotten: list[Pictures] = []

    def options(self) -> Any:
        return SimpleNamespace(quality=80, max_age=1.0)

    def forget(self, stream: Pictures) -> None:
        self.forgotten.append(stream)
        stream.end()


class Source:
    """A stream whose frames come when the test says so, and a receiver that believes them all."""

    def __init__(self, hub: Hub) -> None:
        self.stream = Pictures(KEY, hub)  # type: ignore[arg-type]
        self.stream._receiver = self  # type: ignore[assignment]
        self.number = 0
        self.believe = threading.Event()  # challengers wait for it
        self.believe.set()
        self.accepted: list[tuple[int, str]] = []
        self._hub = hub
        self._slot = Slot[Arrival](lambda _: hub.ledger.drop("overwritten"))

    def arrival(self, timeout_s: float) -> Arrival | None:
        return self._slot.take(timeout_s)

    def accept(self, arrival: Arrival) -> Frame:
        self.accepted.append((arrival.number, threading.current_thread().name))
        if arrival.challenger:
            assert self.believe.wait(5)
        if arrival.payload == b"unforeseen":
            raise MemoryError
        return Frame(arrival.header, compressed=arrival.payload)

    def comes(self, payload: bytes = JPEG, missed: int = 0, challenger: bool = False) -> None:
        self.number += 1
        header = Header(
            camera="front", epoch=1, seq=self.number, stamp_ns=time.time_ns(),
            width=64, height=48, encoding="bgr8",
        )  # fmt: skip
        now_ns = time.monotonic_ns()
        arrival = Arrival(header, payload, False, now_ns, challenger, self.number, missed)
        self._hub.ledger.arrive()
        self._slot.put(arrival, challenger=challenger)
        self.stream._take()


@pytest.fixture
def rendered(monkeypatch) -> list[int]:
    """The numbers of the frames that were rendered, as it happens."""
    found: list[int] = []
    real = renditions.render

    def render(frame: Frame, form: Form, quality: int) -> Any:
        found.append(frame.header.seq)
        return real(frame, form, quality)

    monkeypatch.setattr(renditions, "render", render)
    return found


def run(test: Callable[[Hub, Source], Coroutine[Any, Any, None]]) -> Hub:
    async def main() -> Hub:
        hub = Hub(asyncio.get_running_loop())
        await asyncio.wait_for(test(hub, Source(hub)), 10)
        hub.pool.shutdown()
        return hub

    return asyncio.run(main())


def balance(hub: Hub) -> dict[str, int]:
    counters = hub.ledger.snapshot()
    dropped = sum(count for name, count in counters.items() if name.startswith("dropped."))
    assert counters["received"] == counters["processed"] + dropped + counters["pending"]
    return counters


def test_the_original_bytes_are_handed_on_to_every_client(rendered):
    async def test(hub: Hub, source: Source) -> None:
        feeds = [source.stream.feed(Form()) for _ in range(20)]
        waiting = [asyncio.ensure_future(feed.next(5)) for feed in feeds]
        await asyncio.sleep(0)
        source.comes()
        found = await asyncio.gather(*waiting)
        assert all(picture is found[0] for picture in found)
        assert found[0] is not None
        assert found[0].payload is JPEG

    hub = run(test)
    assert rendered == []
    assert balance(hub)["processed"] == 1


def test_one_form_is_made_once_a_frame_for_twenty_clients(rendered):
    async def test(hub: Hub, source: Source) -> None:
        feeds = [source.stream.feed(SMALL) for _ in range(20)]
        for _ in range(3):
            waiting = [asyncio.ensure_future(feed.next(5)) for feed in feeds]
            await asyncio.sleep(0)
            source.comes()
            found = await asyncio.gather(*waiting)
            assert {(each.width, each.height, each.header.seq) for each in found if each} == {
                (32, 24, source.number)
            }

    run(test)
    assert rendered == [1, 2, 3]


def test_nothing_is_made_while_no_client_is_ready(rendered):
    async def test(hub: Hub, source: Source) -> None:
        feed = source.stream.feed(SMALL)
        for _ in range(50):
            source.comes()
        picture = await feed.next(5)
        assert picture is not None
        assert picture.header.seq == 50

    hub = run(test)
    assert rendered == [50]
    counters = balance(hub)
    assert (counters["processed"], counters["dropped.overwritten"]) == (1, 49)


def test_a_client_that_is_slow_gets_the_newest_and_what_it_missed_is_counted(rendered):
    async def test(hub: Hub, source: Source) -> None:
        feed = source.stream.feed(Form())
        source.comes()
        first = await feed.next(5)
        for _ in range(4):
            source.comes(missed=2)
        second = await feed.next(5)
        assert first is not None
        assert second is not None
        assert (first.header.seq, second.header.seq) == (1, 5)
        assert feed.skipped == 3  # 2, 3 and 4
        assert feed.lost(second) == 2
        assert await feed.next(0.05) is None  # none twice

    run(test)


def test_while_one_frame_is_made_the_next_ones_replace_one_another(rendered, monkeypatch):
    async def test(hub: Hub, source: Source) -> None:
        feed = source.stream.feed(SMALL)
        feed.want()
        for _ in range(30):  # the renderer's thread has no chance to be asked 30 times
            source.comes()
        seen = []
        while not seen or seen[-1] != 30:
            picture = await feed.next(5)
            assert picture is not None
            seen.append(picture.header.seq)
        assert seen == sorted(set(seen))

    run(test)
    assert rendered[0] == 1
    assert len(rendered) <= 3


def test_who_begins_to_watch_gets_the_newest_at_once_but_not_of_a_stream_that_ended(monkeypatch):
    async def test(hub: Hub, source: Source) -> None:
        source.stream.feed(Form()).want()
        source.comes()
        picture = await source.stream.feed(Form()).next(0.05)
        assert picture is not None
        monkeypatch.setattr(pictures, "SILENT_S", 0.0)
        await asyncio.sleep(0.01)
        assert source.stream.silent_s > 0
        assert await source.stream.feed(Form()).next(0.05) is None

    run(test)


@pytest.mark.parametrize("steps_s", [(0, 0.1, 0.1, 60, 0.1, 0.1), (0, 60, 0.1), (0, 0.1, 60)])
def test_a_gap_behind_which_the_camera_came_back_does_not_make_the_next_one_usual(
    monkeypatch, steps_s
):
    now_s = 1000.0
    monkeypatch.setattr(pictures.time, "monotonic", lambda: now_s)

    async def test(hub: Hub, source: Source) -> None:
        nonlocal now_s
        source.stream.feed(Form()).want()
        for step_s in steps_s:
            now_s += step_s
            source.comes()
        now_s += 1.1
        assert source.stream.silent_s == pytest.approx(1.1)

    run(test)


def test_a_picture_that_cannot_be_decoded_is_dropped_and_the_next_is_shown(rendered):
    async def test(hub: Hub, source: Source) -> None:
        feed = source.stream.feed(SMALL)
        feed.want()
        source.comes(JPEG[:300])
        assert await feed.next(0.3) is None
        source.comes()
        picture = await feed.next(5)
        assert picture is not None
        assert picture.header.seq == 2

    hub = run(test)
    counters = balance(hub)
    assert (counters["processed"], counters["dropped.corrupt"]) == (1, 1)


class HeldUp:
    """A renderer that waits for each frame until the test lets it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._go = threading.Semaphore(0)
        self._real = renditions.render
        monkeypatch.setattr(renditions, "render", self._render)

    def _render(self, frame: Frame, form: Form, quality: int) -> Any:
        assert self._go.acquire(timeout=5)
        return self._real(frame, form, quality)

    def let(self, frames: int = 1) -> None:
        self._go.release(frames)


def test_a_frame_that_was_given_after_the_next_had_come_is_the_one_that_counts(monkeypatch):
    renderer = HeldUp(monkeypatch)

    async def test(hub: Hub, source: Source) -> None:
        feed = source.stream.feed(SMALL)
        feed.want()
        source.comes()
        for _ in range(3):
            source.comes()  # while the first is being made
        assert balance(hub)["pending"] == 2  # the first and the newest
        renderer.let()
        first = await feed.next(5)
        assert first is not None
        assert first.header.seq == 1
        counters = balance(hub)
        assert (counters["processed"], counters["dropped.overwritten"]) == (1, 2)
        assert counters["pending"] == 1  # the newest: nobody has got it
        renderer.let()
        last = await feed.next(5)
        assert last is not None
        assert last.header.seq == 4

    counters = balance(run(test))
    assert (counters["processed"], counters["pending"]) == (2, 0)


def test_a_frame_that_several_clients_get_late_and_in_several_forms_counts_once(monkeypatch):
    renderer = HeldUp(monkeypatch)

    async def test(hub: Hub, source: Source) -> None:
        original, small = source.stream.feed(Form()), source.stream.feed(SMALL)
        small.want()
        source.comes()
        assert (await original.next(5)) is not None
        source.comes()
        renderer.let()
        assert (await small.next(5)) is not None
        counters = balance(hub)
        assert (counters["processed"], counters["pending"]) == (1, 1)
        small.close()
        renderer.let(9)

    run(test)


def test_what_was_made_and_not_taken_is_dropped_when_its_form_is_wanted_no_more(monkeypatch):
    async def test(hub: Hub, source: Source) -> None:
        source.stream.feed(Form())
        small = source.stream.feed(SMALL)
        small.want()
        source.comes()
        while source.stream.newest is None or not small.waiting:
            await asyncio.sleep(0.01)
        source.comes()
        assert balance(hub)["pending"] == 2
        small.close()
        counters = balance(hub)
        assert (counters["dropped.overwritten"], counters["pending"]) == (1, 1)

    run(test)


def test_the_first_frame_of_a_run_is_decoded_elsewhere_and_before_those_that_follow():
    async def test(hub: Hub, source: Source) -> None:
        feed = source.stream.feed(Form())
        feed.want()
        source.believe.clear()
        source.comes(challenger=True)
        for _ in range(4):
            source.comes()
        assert await feed.next(0.1) is None  # the loop goes round meanwhile
        assert balance(hub)["dropped.overwritten"] == 3
        source.believe.set()
        newest = await feed.next(5)
        assert newest is not None
        assert newest.header.seq == 5
        (first, elsewhere), (second, here) = source.accepted
        assert (first, second) == (1, 5)
        assert elsewhere != here == threading.current_thread().name

    counters = balance(run(test))
    assert (counters["processed"], counters["dropped.overwritten"]) == (1, 4)


def test_a_first_frame_that_is_decoded_after_all_have_left_was_for_nobody():
    async def test(hub: Hub, source: Source) -> None:
        feed = source.stream.feed(Form())
        source.believe.clear()
        source.comes(challenger=True)
        feed.close()
        source.believe.set()
        while balance(hub)["pending"]:
            await asyncio.sleep(0.01)

    assert balance(run(test))["dropped.unwatched"] == 1


def test_a_first_frame_that_fails_as_none_should_does_not_hold_up_the_next():
    async def test(hub: Hub, source: Source) -> None:
        feed = source.stream.feed(Form())
        feed.want()
        source.comes(b"unforeseen", challenger=True)
        source.comes(challenger=True)
        picture = await feed.next(5)
        assert picture is not None
        assert picture.header.seq == 2

    counters = balance(run(test))
    assert (counters["processed"], counters["dropped.not_rendered"]) == (1, 1)


def test_the_last_clients_leave_ends_the_stream():
    async def test(hub: Hub, source: Source) -> None:
        feeds = [source.stream.feed(form) for form in (Form(), Form(), SMALL)]
        source.comes()
        for feed in feeds[:-1]:
            feed.close()
            assert not hub.forgotten
        feeds[-1].close()
        assert hub.forgotten == [source.stream]

    hub = run(test)
    assert balance(hub)["dropped.unwatched"] == 1


def test_a_challenger_that_waits_behind_a_frame_is_taken_without_another_to_come():
    async def test(hub: Hub, source: Source) -> None:
        source.stream.feed(Form()).want()
        taken, source.stream._take = source.stream._take, lambda: None  # type: ignore[method-assign]
        source.comes(challenger=True)
        source.comes()
        source.stream._take = taken  # type: ignore[method-assign]
        source.stream._take()
        while len(source.accepted) < 2:  # the deadline is run's
            await asyncio.sleep(0.01)
        assert [number for number, _ in source.accepted] == [2, 1]

    run(test)
