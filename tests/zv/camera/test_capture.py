"""A source under settings that change: what is opened again, and which revision a picture has."""

from __future__ import annotations

import gc
import queue
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from tests.support.waiting import DEADLINE_S, wait_until
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.errors import SourceError, SourceLost
from zenoh_vision.image.picture import PixelPicture
from zenoh_vision.stream.counters import FrameCounters
from zv.camera import capture
from zv.camera.capture import Capture
from zv.camera.reader import CapturedFrame
from zv.camera.settings import CameraSettings
from zv.camera.sources.base import TimedPicture


class ScriptedSource:
    """Gives a picture whenever the test says so; as wide as it was opened with."""

    description = "scripted"

    def __init__(self, settings: CameraSettings, *, live: bool, period_s: float = 0.0) -> None:
        self.live = live
        self.rate_hz: float | None = 30.0
        self.closed = False
        self.given: queue.Queue[str] = queue.Queue()
        self.reading = threading.Event()
        self._width = settings.width or 16
        self._count = 0
        self._period_s = period_s

    def read(self) -> TimedPicture | None:
        if self._count:
            self.given.task_done()  # the picture before is handed over, or thinned out
        self.reading.set()
        word = self.given.get(timeout=60)
        self.reading.clear()
        if word == "end":
            return None
        level = 0 if word == "same" else self._count % 256
        pixels = np.full((16, self._width, 3), level, np.uint8)
        due_s = None if self.live else self._count * self._period_s
        self._count += 1
        if word == "late":  # 3 s old, and 5 older ones were skipped for it
            old_ns = time.time_ns() - 3_000_000_000
            return TimedPicture(PixelPicture(pixels), stamp_ns=old_ns, skipped=5)
        if word == "lost":
            now_ns = time.time_ns()
            return TimedPicture(PixelPicture(pixels), stamp_ns=now_ns, lost=3, packets_lost=2)
        return TimedPicture(PixelPicture(pixels), due_s=due_s)

    def close(self) -> None:
        self.closed = True
        self.given.put("end")


class Rig:
    """A capture on a thread, with the sources that it opened and the pictures that it gave."""

    def __init__(self, settings: CameraSettings, *, live: bool, period_s: float) -> None:
        self.parameters = ParameterStore(settings)
        self.sources: list[ScriptedSource] = []
        self.pictures: list[CapturedFrame] = []
        self.at_s: list[float] = []
        self.troubles: list[str] = []
        self.remarks: list[tuple[str, str]] = []
        self.broken: Callable[[CameraSettings], bool] = lambda _settings: False
        self.gives_at_once = False

        def open_source(
            opened: CameraSettings, newest: Callable[[], CameraSettings]
        ) -> ScriptedSource:
            if self.broken(opened):
                raise SourceError("the device cannot do that")
            assert all(source.closed for source in self.sources), "opened while another is open"
            self.sources.append(ScriptedSource(opened, live=live, period_s=period_s))
            if self.gives_at_once:
                self.sources[-1].given.put("picture")
            return self.sources[-1]

        self.counters = FrameCounters("captured", "published")
        self.capture = Capture(self.parameters, self.counters, open_source)
        self._stop = threading.Event()
        self._asked = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def remark(self, condition: str, words: str) -> None:
        self.remarks.append((condition, words))

    def _stopping(self) -> bool:
        self._asked.set()
        return self._stop.is_set()

    def _run(self) -> None:
        for captured in self.capture.frames(self._stopping, self.troubles.append, self.remark):
            self.at_s.append(time.monotonic())
            self.pictures.append(captured)

    def start_reading(self) -> None:
        self._thread.start()
        assert self._asked.wait(DEADLINE_S)  # a live source's pictures before that are lost

    def stop(self) -> None:
        self._stop.set()
        self._thread.join(DEADLINE_S)
        for source in self.sources:
            source.close()
        self.capture.__exit__(None, None, None)

    def give(self, count: int = 1, word: str = "picture") -> list[CapturedFrame]:
        """Have the newest source give so many pictures, and return them."""
        for _ in range(count):
            before = len(self.pictures)
            self.sources[-1].given.put(word)
            wait_until(lambda before=before: len(self.pictures) > before)
        return self.pictures[-count:]


@contextmanager
def unstarted(
    source: str, *, live: bool, period_s: float = 0.0, **settings: object
) -> Iterator[Rig]:
    rig = Rig(
        CameraSettings.model_validate({"source": source, **settings}), live=live, period_s=period_s
    )
    try:
        yield rig
    finally:
        rig.stop()


@contextmanager
def rigged(source: str, *, live: bool, period_s: float = 0.0, **settings: object) -> Iterator[Rig]:
    with unstarted(source, live=live, period_s=period_s, **settings) as rig:
        rig.capture.open()
        rig.start_reading()
        yield rig


def numbers(pictures: list[CapturedFrame]) -> list[int]:
    return [captured.revision.number for captured in pictures]


def test_a_device_follows_what_it_can_without_being_opened_again():
    with rigged("0", live=True) as rig:
        rig.give(2)
        for changes in ({"quality": 5}, {"flip": "both"}, {"encoding": "mono8", "loop": True}):
            rig.parameters.change(changes)
            rig.give()
        assert numbers(rig.pictures) == [0, 0, 1, 2, 3]
        assert [captured.seq for captured in rig.pictures] == [0, 1, 2, 3, 4]
        assert len(rig.sources) == 1


def test_a_picture_that_a_device_took_while_the_camera_waited_for_its_router_is_not_published():
    with unstarted("0", live=True) as rig:
        rig.capture.open()
        waiting = rig.sources[0]
        for _ in range(3):
            waiting.given.put("picture")
        wait_until(lambda: not waiting.given.unfinished_tasks)
        rig.start_reading()
        (first,) = rig.give()
        assert first.picture.pixels[0, 0, 0] == 3
        assert first.seq == 0


def test_a_file_is_not_read_while_the_camera_waits_for_its_router():
    with unstarted("clip.avi", live=False) as rig:
        rig.capture.open()
        assert not rig.sources[0].reading.wait(0.1)
        rig.start_reading()
        (first,) = rig.give()
        assert first.picture.pixels[0, 0, 0] == 0


def test_a_picture_that_comes_after_a_change_is_made_with_it_though_reading_began_before():
    with rigged("0", live=True) as rig:
        rig.give()
        assert rig.sources[0].reading.wait(DEADLINE_S)  # it waits for the device
        rig.parameters.change({"quality": 5})
        (captured,) = rig.give()
        assert (captured.revision.number, captured.revision.settings.quality) == (1, 5)


def test_a_device_is_opened_again_for_another_size_in_a_new_epoch_once_the_old_one_is_closed():
    with rigged("0", live=True, width=16) as rig:
        rig.give(2)
        rig.parameters.change({"width": 32, "quality": 5})
        # More of the size before: nobody may get them as of the new.
        wait_until(lambda: rig.sources[0].given.put("picture") or len(rig.sources) == 2)
        rig.give()
        first, last = rig.pictures[0], rig.pictures[-1]
        assert (last.picture.width, last.seq, last.revision.number) == (32, 0, 1)
        assert last.epoch > first.epoch
        assert rig.sources[0].closed
        assert rig.troubles == []
        sizes = {(c.revision.settings.width, c.picture.width) for c in rig.pictures}
        assert sizes == {(16, 16), (32, 32)}


def test_the_first_picture_of_a_device_that_is_opened_again_is_published():
    with rigged("0", live=True, width=16) as rig:
        rig.give()
        rig.gives_at_once = True  # the first picture is the only one
        for width in range(32, 52):
            before = rig.sources[-1]
            rig.parameters.change({"width": width})
            before.given.put("end")
            wait_until(lambda width=width: rig.pictures[-1].picture.width == width)


def test_a_size_that_the_device_refuses_is_given_back_by_the_next_change():
    with rigged("0", live=True, reopen_min=60, reopen_max=60) as rig:
        rig.broken = lambda settings: settings.width == 7680
        rig.give()
        rig.parameters.change({"width": 7680})
        rig.sources[0].given.put("end")
        wait_until(lambda: rig.troubles)
        assert "the device cannot do that" in rig.troubles[0]
        rig.parameters.change({"width": 32})  # at once, not after the 60 s
        wait_until(lambda: len(rig.sources) == 2)
        assert rig.give()[0].picture.width == 32
        assert rig.troubles[-1] == ""


def test_a_faster_rate_ends_the_wait_for_a_picture_that_was_due_much_later():
    with rigged("clip.avi", live=False, period_s=1000.0, rate=0.001) as rig:
        rig.give()
        rig.sources[0].given.put("picture")  # due in 1000 s
        wait_until(lambda: rig.sources[0].given.empty())
        rig.parameters.change({"rate": 1000.0})
        wait_until(lambda: len(rig.pictures) == 2)
        assert numbers(rig.pictures) == [0, 1]
        rig.give(3)
        assert len(rig.sources) == 1


def test_a_change_of_something_else_does_not_disturb_the_wait():
    with rigged("clip.avi", live=False, period_s=1000.0, rate=4.0) as rig:
        begun_s = time.monotonic()
        rig.give()
        rig.sources[0].given.put("picture")
        wait_until(lambda: rig.sources[0].given.empty())
        for quality in range(1, 20):
            rig.parameters.change({"quality": quality})
        wait_until(lambda: len(rig.pictures) == 2)
        assert rig.at_s[1] - begun_s > 1 / 4  # due that long after the first, which came later
        assert numbers(rig.pictures) == [0, 19]


def test_a_source_that_is_too_fast_is_thinned_out_at_the_rate_of_now():
    with rigged("0", live=True, rate=1000.0) as rig:
        given = rig.sources[0].given
        rig.give()
        wait_until(lambda: not given.unfinished_tasks)
        rig.parameters.change({"rate": 0.0001})
        rig.give()  # the first at a rate is always passed on
        for _ in range(5):
            given.put("picture")
        wait_until(lambda: not given.unfinished_tasks)
        assert len(rig.pictures) == 2
        rig.parameters.change({"rate": 1000.0})  # it was asked for that when it was opened
        # Any two may come within a millisecond, which is too fast for this rate as well.
        wait_until(lambda: given.put("picture") or len(rig.pictures) >= 5)
        assert len(rig.sources) == 1


def test_a_still_picture_goes_on_being_published_and_is_remarked_until_it_changes():
    with rigged("0", live=True, frozen_after=0.2) as rig:
        given = rig.give(3, "same")
        wait_until(lambda: given.extend(rig.give(1, "same")) or rig.remarks)
        given += rig.give(2, "same")
        assert [each.seq for each in given] == list(range(len(given)))
        assert len({each.epoch for each in given}) == 1
        ((condition, words),) = rig.remarks
        assert condition == "still"
        assert words.startswith("the picture has not changed for over 0.2 s: a screen or ")
        assert rig.counters.snapshot()["repeated"] == len(given) - 1
        rig.give()
        wait_until(lambda: len(rig.remarks) == 2)
        assert rig.remarks[1] == ("still", "")
        assert (rig.troubles, len(rig.sources)) == ([], 1)


def test_a_source_that_lags_has_true_stamps_counts_what_it_skipped_and_says_so():
    with rigged("rtsp://camera/1", live=True) as rig:
        (first,) = rig.give()
        (late,) = rig.give(1, "late")
        assert (first.seq, late.seq) == (0, 6)
        assert late.stamp_ns < first.stamp_ns
        wait_until(lambda: rig.remarks)
        condition, words = rig.remarks[0]
        assert condition == "lag"
        assert words.startswith(("pictures are 3", "5 pictures of the last 10 s were"))
        counters = rig.counters.snapshot()
        assert counters["dropped.lagging"] == 5
        assert counters["captured"] == 7
        rig.parameters.change({"max_lag": 0.0})
        wait_until(lambda: rig.remarks[-1] == ("lag", ""))


def test_how_old_the_newest_picture_was_when_it_came_is_known():
    with rigged("rtsp://camera/1", live=True) as rig:
        assert rig.capture.lag_ms() is None

        def lag_ms(*late: str) -> float:
            rig.give(1, *late)
            return rig.capture.lag_ms() or 0.0

        wait_until(lambda: lag_ms("late") >= 3000)
        wait_until(lambda: lag_ms() < 3000)


def test_equal_pictures_are_left_out_when_that_is_wanted():
    with rigged("0", live=True, frozen_after=0.0, skip_repeats=True) as rig:
        rig.give(1, "same")
        for _ in range(4):
            rig.sources[-1].given.put("same")
        (last,) = rig.give()
        assert last.seq == 5
        assert rig.counters.snapshot()["dropped.repeated"] == 4
        assert rig.remarks == []


def test_stalls_leave_no_reader_behind_that_could_have_ended():
    settings = CameraSettings(
        width=32,
        height=32,
        rate=100,
        faults="stall@3+999999",
        stall_after=0.3,
        reopen_min=0.01,
        reopen_max=0.01,
    )
    epochs: set[int] = set()
    with Capture(ParameterStore(settings), FrameCounters("captured", "published")) as capture:
        capture.open()
        for captured in capture.frames(
            lambda: len(epochs) == 5, lambda _trouble: None, lambda _condition, _words: None
        ):
            epochs.add(captured.epoch)
        wait_until(lambda: len(readers_of(epochs)) <= 1)


def readers_of(epochs: set[int]) -> list[threading.Thread]:
    names = {f"source {epoch}" for epoch in epochs}
    return [thread for thread in threading.enumerate() if thread.name in names]


@pytest.fixture
def clip(tmp_path, monkeypatch):
    """A file that exists: what kind of source it is depends on that."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "clip.avi").write_bytes(b"x")


pytestmark = pytest.mark.usefixtures("clip")


def test_openings_that_do_not_end_are_limited_and_it_goes_on_when_one_ends(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(capture, "MARGIN_S", 0.0)
    stuck, begun = threading.Event(), 0
    with rigged("0", live=True, stall_after=0.1, reopen_min=0.01) as rig:
        rig.give()

        def blocks(_settings: CameraSettings) -> bool:
            nonlocal begun
            begun += 1
            stuck.wait(20)
            return True

        rig.broken = blocks
        rig.sources[-1].given.put("end")
        wait_until(lambda: capture.STUCK in rig.troubles)
        assert begun == capture.MAX_ABANDONED
        rig.broken = lambda _settings: False
        stuck.set()
        wait_until(lambda: len(rig.sources) == 2)
        rig.give()
        assert begun == capture.MAX_ABANDONED


def test_the_reason_of_a_source_that_is_lost_is_said_though_it_takes_long_to_close():
    closed = threading.Event()

    class Stalled(ScriptedSource):
        def read(self) -> TimedPicture | None:
            threading.Event().wait(0.3)  # its own time-out, that of ``stall_after``
            raise SourceLost("a firewall stops it")

        def close(self) -> None:
            closed.wait(DEADLINE_S)

    settings = CameraSettings(source="rtsp://camera/1", stall_after=0.3, reopen_min=60.0)
    troubles: list[str] = []
    parameters = ParameterStore(settings)

    def open_source(settings: CameraSettings, _newest: object) -> Stalled:
        return Stalled(settings, live=True)

    with Capture(parameters, FrameCounters("captured", "published"), open_source) as running:
        for _ in running.frames(lambda: bool(troubles), troubles.append, lambda *_: None):
            pass
        closed.set()
    assert troubles == ["a firewall stops it; opening rtsp://camera/1 again in 60 s"]


def test_openings_that_never_end_end_the_process_so_that_it_is_started_again(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(capture, "MARGIN_S", 0.0)
    monkeypatch.setattr(capture, "STUCK_S", 0.2)
    # Each reader is stuck in its driver, which only the end of the process frees.
    stuck = threading.Event()
    settings = CameraSettings(
        source="/dev/video0", stall_after=0.1, reopen_min=0.01, reopen_max=0.01
    )
    opened: list[float] = []

    def open_source(_settings: CameraSettings, _newest: object) -> ScriptedSource:
        opened.append(time.monotonic())
        stuck.wait(DEADLINE_S)
        raise SourceError("released")

    troubles: list[str] = []
    parameters = ParameterStore(settings)
    with Capture(parameters, FrameCounters("captured", "published"), open_source) as running:
        with pytest.raises(SourceError, match=r"^/dev/video0: two readers are stuck") as caught:
            for _ in running.frames(lambda: False, troubles.append, lambda *_: None):
                pass
        stuck.set()
    assert caught.value.exit_status == 3
    assert len(opened) == capture.MAX_ABANDONED
    assert capture.STUCK in troubles


def test_pictures_that_were_lost_at_the_source_have_numbers_and_are_counted():
    with rigged("0", live=True) as rig:
        found = [*rig.give(), *rig.give(word="lost"), *rig.give()]
        assert [each.seq for each in found] == [0, 4, 5]
        counts = rig.counters.snapshot()
        assert (counts["captured"], counts["dropped.at_source"]) == (6, 3)
        assert counts["packets_lost"] == 2
        wait_until(lambda: rig.remarks)
        ((condition, words),) = rig.remarks
        assert condition == "loss"
        assert words.startswith("2 packets of the last 10 s were lost in the network")


def test_a_closed_source_gives_its_memory_back_without_the_garbage_collector():
    opened: list[weakref.ref[ScriptedSource]] = []

    def open_source(settings: CameraSettings, _newest: object) -> ScriptedSource:
        source = ScriptedSource(settings, live=True)
        opened.append(weakref.ref(source))
        return source

    store = ParameterStore(CameraSettings(source="0"))
    gc.disable()
    try:
        with Capture(store, FrameCounters("captured", "published"), open_source) as camera:
            camera.open()
            source = opened[0]()
            source.given.put("end")
            del source
        wait_until(lambda: opened[0]() is None)
    finally:
        gc.enable()


def test_a_slow_source_whose_pictures_all_differ_is_not_remarked_as_still():
    with rigged("0", live=True, frozen_after=0.2) as rig:
        rig.give()
        time.sleep(0.5)  # longer than the limit, as between the pictures of a low rate
        rig.give()
        assert rig.remarks == []


def test_what_was_skipped_before_a_picture_that_the_rate_leaves_out_is_counted_and_remarked():
    with rigged("0", live=True, rate=0.01, max_lag=0.5) as rig:
        rig.give()
        rig.sources[-1].given.put("late")
        wait_until(lambda: rig.remarks)
        condition, words = rig.remarks[0]
        assert condition == "lag"
        assert words.startswith("pictures are 3.")
        assert len(rig.pictures) == 1
        assert rig.counters.snapshot()["dropped.lagging"] == 5


def test_what_is_said_of_a_program_that_fails_does_not_have_its_arguments():
    with rigged("command:vendor --user admin --pass s3cret", live=True, reopen_min=0.1) as rig:
        rig.give()
        rig.sources[-1].given.put("end")
        wait_until(lambda: rig.troubles)
        assert "opening command vendor again" in rig.troubles[0]
        assert "s3cret" not in rig.troubles[0]
