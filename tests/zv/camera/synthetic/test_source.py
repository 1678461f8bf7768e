"""The synthetic camera as a source: its pictures, their times, its faults."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.support.pictures.frame_numbers import read_number
from zv.camera.sources.base import KnowsNextDue, Source, TimedPicture
from zv.camera.synthetic.faults import parse_faults
from zv.camera.synthetic.scene import Scene
from zv.camera.synthetic.source import Conditions, SyntheticSource

SIZE, SEED = (96, 72), 5


class RecordedWaits(threading.Event):
    """An event that writes down how long it was waited for, instead of waiting."""

    def __init__(self, called: Callable[[int], object] = lambda _: None) -> None:
        super().__init__()
        self.waits_s: list[float] = []
        self._called = called

    def wait(self, timeout: float | None = None) -> bool:
        self._called(len(self.waits_s))
        self.waits_s.append(timeout or 0.0)
        return self.is_set()


class Rig:
    """A source at 10 Hz whose conditions a test changes between two pictures."""

    def __init__(self, faults: str = "", **fields: Any) -> None:
        self.now = Conditions(10.0)
        self.set(faults, **fields)
        self.waits = RecordedWaits()
        self.source = SyntheticSource(SIZE, SEED, lambda: self.now, stop=self.waits)

    def set(self, faults: str = "", **fields: Any) -> None:
        """Change the faults, which are none by default, and other conditions."""
        self.now = replace(self.now, faults=parse_faults(faults), **fields)

    def take(self, count: int = 1) -> list[TimedPicture]:
        pictures = [self.source.read() for _ in range(count)]
        return [picture for picture in pictures if picture is not None]

    def pixels(self, count: int = 1) -> list[np.ndarray]:
        return [each.picture.pixels for each in self.take(count)]

    def frames(self, count: int) -> list[int]:
        """Return which frames the next pictures are, by their due times at 10 Hz."""
        return [round((each.due_s or 0.0) * 10) for each in self.take(count)]


def scene(noise: float = 2.0, objects: int = 4) -> Scene:
    return Scene(*SIZE, 10.0, SEED, noise, objects)


def test_it_is_a_source_that_the_camera_paces() -> None:
    source: Source = Rig().source
    assert isinstance(source, KnowsNextDue)
    assert (source.live, source.rate_hz) == (False, 10.0)
    assert source.description == "synthetic scene (96x72, 10 Hz, seed 5)"


def test_picture_k_is_frame_k_of_the_scene_with_its_truth() -> None:
    pictures = Rig().take(40)
    for k, timed in enumerate(pictures):
        expected, truth = scene().frame(k)
        assert (timed.picture.encoding, timed.picture.size) == ("bgr8", SIZE)
        assert np.array_equal(timed.picture.pixels, expected)
        assert timed.truth == truth
        assert timed.due_s == pytest.approx(k / 10)
    assert pictures[39].truth


def test_a_closed_source_delivers_no_more() -> None:
    rig = Rig()
    assert rig.source.next_due_s() == 0.0
    assert rig.take()
    rig.source.close()
    rig.source.close()
    assert (rig.source.read(), rig.source.next_due_s()) == (None, None)


@pytest.mark.parametrize(("kind", "waits_s"), [("drop", 0.0), ("stall", 0.4)])
def test_a_drop_skips_its_frames_at_once_and_a_stall_after_their_time(kind: str, waits_s: float):
    rig = Rig(f"{kind}@3+4")
    assert rig.frames(8) == [0, 1, 2, 7, 8, 9, 10, 11]
    assert sum(rig.waits.waits_s) == pytest.approx(waits_s)  # 4 frames at 10 Hz


@pytest.mark.parametrize(("after", "due_s"), [("", 0.5), ("drop@5+2", 0.7), ("drop@now+3", 0.8)])
def test_faults_that_change_during_a_drop_take_it_back(after: str, due_s: float) -> None:
    rig = Rig("drop@5+10,drop@15+999990")
    rig.take(5)
    assert rig.source.next_due_s() == pytest.approx(100_000.5)
    rig.set(after)
    assert rig.source.next_due_s() == pytest.approx(due_s)
    assert rig.frames(2) == [round(10 * due_s), round(10 * due_s) + 1]


def test_a_stall_that_begins_inside_a_drop_blocks_for_what_is_left_of_it() -> None:
    rig = Rig("drop@2+3,stall@4+4")
    assert rig.frames(3)[2] == 8
    assert sum(rig.waits.waits_s) == pytest.approx(0.3)  # frames 5, 6 and 7


def test_closing_ends_a_stall_at_once() -> None:
    conditions = Conditions(faults=parse_faults("stall@1+999999"))
    opened = SyntheticSource(SIZE, SEED, lambda: conditions)
    assert opened.read() is not None
    results: list[TimedPicture | None] = []
    reader = threading.Thread(target=lambda: results.append(opened.read()), daemon=True)
    reader.start()
    opened.close()
    reader.join(10.0)
    assert results == [None]


def test_a_stall_ends_when_its_fault_is_taken_away() -> None:
    rig = Rig("stall@now+999999")
    rig.waits._called = lambda count: rig.set() if count == 5 else None
    # 6 waits of 0.05 s are 3 frames at 10 Hz; the next frame that is due is frame 3.
    assert rig.frames(2) == [3, 4]


def test_a_frozen_source_repeats_exactly_one_picture_and_its_truth() -> None:
    pictures, untouched = Rig("frozen@21+5").take(30), Rig().take(30)
    shows = [each.picture.pixels for each in pictures]
    for k in range(30):
        same = 21 if 21 <= k < 26 else k
        assert np.array_equal(shows[k], untouched[same].picture.pixels)
        assert pictures[k].truth == untouched[same].truth
        assert pictures[k].due_s == pytest.approx(k / 10)


def brightness(pixels: np.ndarray, k: int) -> float:
    """Return how many times brighter it is than frame k of the scene without noise."""
    return float(pixels.mean()) / float(scene(noise=0.0).render(k).mean())


def test_a_lighting_step_makes_its_frames_brighter_by_a_third_and_no_others() -> None:
    for k, timed in enumerate(Rig("lighting@4+3", noise=0.0).take(12)):
        # 1.35 in the light; a little less where bright places saturate.
        expected = pytest.approx(1.35 if k in (4, 5, 6) else 1.0, abs=0.03)
        assert brightness(timed.picture.pixels, k) == expected
        assert timed.truth == scene().truth(k)


def test_a_fault_from_now_on_begins_with_the_next_frame_and_is_not_begun_again() -> None:
    rig = Rig(noise=0.0)
    rig.take(3)
    rig.set("lighting@now+2")
    lit = rig.pixels(2)
    rig.set("lighting@now+2", numbered=False)
    shows = [*lit, *rig.pixels()]
    bright = [brightness(each, k) > 1.2 for k, each in enumerate(shows, 3)]
    assert bright == [True, True, False]


def test_at_another_rate_the_scene_goes_on_at_its_own_speed() -> None:
    rig = Rig()
    before = rig.take(4)
    rig.set(rate_hz=2.0)
    after = rig.take(3)
    due_s = [each.due_s for each in before + after]
    assert due_s == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.8, 1.3, 1.8])
    assert rig.source.rate_hz == 2.0
    assert after[1].truth == scene().truth(13)  # frame 13 at 10 Hz is at 1.3 s too


def test_the_first_picture_may_have_another_rate_than_the_source_was_opened_with() -> None:
    rig = Rig()
    rig.set(rate_hz=2.0)
    assert [each.due_s for each in rig.take(3)] == [0.0, 0.5, 1.0]


def test_noise_and_objects_change_in_the_scene_that_is_shown() -> None:
    rig = Rig()
    rig.take(30)
    rig.set(noise=0.0)
    (quiet,) = rig.take()
    expected, truth = scene(noise=0.0).frame(30)
    assert np.array_equal(quiet.picture.pixels, expected)
    assert quiet.truth == truth != ()
    rig.set(objects=0)
    assert np.array_equal(rig.pixels()[0], scene().background())


def test_it_knows_when_the_next_picture_is_due_and_draws_it_by_what_holds_then() -> None:
    rig = Rig(noise=0.0)
    rig.take(5)
    assert [rig.source.next_due_s(), rig.source.next_due_s()] == pytest.approx([0.5, 0.5])
    rig.set("drop@now+3,lighting@8+1")
    assert rig.source.next_due_s() == pytest.approx(0.8)
    rig.set(rate_hz=2.0)
    # The drop is taken back, and the next picture follows that of 0.4 s at the new rate.
    assert rig.source.next_due_s() == pytest.approx(0.9)
    (timed,) = rig.take()
    assert timed.due_s == pytest.approx(0.9)
    assert np.array_equal(timed.picture.pixels, scene(noise=0.0).render(9))


@pytest.mark.parametrize(
    ("faults", "numbers"),
    [
        ("drop@3+4,stall@9+2,lighting@12+2", list(range(9))),
        ("frozen@3+3", [0, 1, 2, 3, 3, 3, 6, 7]),
    ],
    ids=["what is left out is not counted", "a repeated picture keeps its number"],
)
def test_the_number_counts_the_pictures(faults: str, numbers: list[int]) -> None:
    shows = Rig(faults, numbered=True).pixels(len(numbers))
    assert [read_number(each) for each in shows] == numbers


def test_numbers_and_depth_come_and_go_while_it_is_open() -> None:
    rig = Rig()
    assert read_number(rig.pixels()[0]) is None
    rig.set(numbered=True)
    assert read_number(rig.pixels()[0]) == 1
    rig.set(depth=True)
    (deep,) = rig.take()
    assert deep.picture.encoding == "16UC1"
    assert np.array_equal(deep.picture.pixels, scene().depth(2)[0])
    assert deep.truth == scene().truth(2)


def test_a_frozen_picture_of_depth_is_a_new_one_after_the_change_to_colours() -> None:
    rig = Rig("frozen@0+5", depth=True)
    first, second = rig.pixels(2)
    assert np.array_equal(first, second)
    rig.now = replace(rig.now, depth=False)
    assert rig.pixels()[0].dtype == np.uint8
