"""The synthetic camera as a source: its pictures, their times, its faults."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest

from tests.support.pictures.frame_numbers import read_number
from zv.camera.sources.base import KnowsNextDue, Picture, Source
from zv.camera.synthetic.faults import parse_faults
from zv.camera.synthetic.scene import Scene
from zv.camera.synthetic.source import Conditions, SyntheticSource


class RecordedWaits(threading.Event):
    """An event that writes down how long it was waited for, instead of waiting."""

    def __init__(self) -> None:
        super().__init__()
        self.waits_s: list[float] = []

    def wait(self, timeout: float | None = None) -> bool:
        self.waits_s.append(timeout or 0.0)
        return self.is_set()


def conditions(faults: str = "", rate_hz: float = 10.0, noise: float = 2.0) -> Conditions:
    return Conditions(rate_hz, noise, objects=4, faults=parse_faults(faults))


def source(
    faults: str = "",
    *,
    rate_hz: float = 10.0,
    noise: float = 2.0,
    stop: threading.Event | None = None,
) -> SyntheticSource:
    found = conditions(faults, rate_hz, noise)
    return SyntheticSource((96, 72), 5, lambda: found, stop=stop)


def taken(opened: SyntheticSource, count: int) -> list[Picture]:
    pictures = [opened.read() for _ in range(count)]
    assert None not in pictures
    return [picture for picture in pictures if picture is not None]


def frame_numbers(pictures: list[Picture]) -> list[int]:
    """Which frames these are, by their due times at 10 Hz."""
    return [round((picture.due_s or 0.0) * 10) for picture in pictures]


def pixels_of(picture: Picture) -> np.ndarray[Any, np.dtype[Any]]:
    assert picture.pixels is not None
    return picture.pixels


def test_it_is_a_source_that_the_camera_paces() -> None:
    opened: Source = source()
    assert not opened.live
    assert opened.rate_hz == 10.0
    assert opened.description == "synthetic scene (96x72, 10 Hz, seed 5)"


def test_picture_k_is_frame_k_of_the_scene_with_its_truth() -> None:
    scene = Scene(96, 72, rate_hz=10.0, seed=5, noise=2.0, objects=4)
    pictures = taken(source(), 40)
    for k, picture in enumerate(pictures):
        expected, truth = scene.frame(k)
        assert (picture.encoding, picture.width, picture.height) == ("bgr8", 96, 72)
        assert np.array_equal(pixels_of(picture), expected)
        assert picture.truth == truth
    assert pictures[39].truth


def test_frame_k_is_due_at_k_over_the_rate() -> None:
    due_s = [picture.due_s for picture in taken(source(rate_hz=25.0), 4)]
    assert due_s == pytest.approx([0.0, 0.04, 0.08, 0.12])


def test_a_closed_source_delivers_no_more() -> None:
    opened = source()
    assert opened.read() is not None
    opened.close()
    opened.close()
    assert opened.read() is None


def test_a_drop_skips_its_frames_without_waiting() -> None:
    stop = RecordedWaits()
    pictures = taken(source("drop@3+4", stop=stop), 8)
    assert frame_numbers(pictures) == [0, 1, 2, 7, 8, 9, 10, 11]
    assert stop.waits_s == []


def test_a_stall_blocks_for_its_frame_times_and_goes_on_with_the_frame_due_then() -> None:
    stop = RecordedWaits()
    pictures = taken(source("stall@3+4", stop=stop), 8)
    assert frame_numbers(pictures) == [0, 1, 2, 7, 8, 9, 10, 11]
    assert sum(stop.waits_s) == pytest.approx(0.4)  # 4 frames at 10 Hz


@pytest.mark.parametrize(("after", "due_s"), [("", 0.5), ("drop@5+2", 0.7), ("drop@now+3", 0.8)])
def test_faults_that_change_during_a_drop_take_it_back(after: str, due_s: float) -> None:
    changing = [conditions("drop@5+10,drop@15+999990")]
    opened = SyntheticSource((96, 72), 5, lambda: changing[-1])
    taken(opened, 5)
    assert opened.next_due_s() == pytest.approx(100_000.5)
    changing.append(conditions(after))
    assert opened.next_due_s() == pytest.approx(due_s)
    assert frame_numbers(taken(opened, 2)) == [round(10 * due_s), round(10 * due_s) + 1]


def test_a_stall_that_begins_inside_a_drop_blocks_for_what_is_left_of_it() -> None:
    stop = RecordedWaits()
    assert frame_numbers(taken(source("drop@2+3,stall@4+4", stop=stop), 3))[2] == 8
    assert sum(stop.waits_s) == pytest.approx(0.3)  # frames 5, 6 and 7


def test_closing_ends_a_stall_at_once() -> None:
    opened = source("stall@1+999999")
    assert opened.read() is not None
    results: list[Picture | None] = []
    reader = threading.Thread(target=lambda: results.append(opened.read()), daemon=True)
    reader.start()
    opened.close()
    reader.join(10.0)
    assert results == [None]


def test_a_frozen_source_repeats_exactly_one_picture_and_its_truth() -> None:
    pictures = taken(source("frozen@21+5"), 30)
    for repeated in pictures[22:26]:
        assert np.array_equal(pixels_of(repeated), pixels_of(pictures[21]))
        assert repeated.truth == pictures[21].truth
    for k in (20, 26):
        assert not np.array_equal(pixels_of(pictures[k]), pixels_of(pictures[21]))
    assert frame_numbers(pictures) == list(range(30))
    untouched = taken(source(), 30)
    assert np.array_equal(pixels_of(pictures[26]), pixels_of(untouched[26]))


def test_painting_on_a_frozen_picture_leaves_the_next_one_alone() -> None:
    opened = source("frozen@0+2")
    first, second = opened.read(), None
    assert first is not None
    before = pixels_of(first).copy()
    pixels_of(first)[:] = 0
    second = opened.read()
    assert second is not None
    assert np.array_equal(pixels_of(second), before)


def test_a_lighting_step_makes_its_frames_brighter_by_a_third_and_no_others() -> None:
    stepped = taken(source("lighting@4+3", noise=0.0), 12)
    plain = taken(source(noise=0.0), 12)
    for k, (one, other) in enumerate(zip(stepped, plain, strict=True)):
        ratio = float(pixels_of(one).mean()) / float(pixels_of(other).mean())
        # 1.35 in the light; a little less where bright places saturate.
        assert ratio == pytest.approx(1.35 if k in (4, 5, 6) else 1.0, abs=0.03)
        assert one.truth == other.truth


class Changing:
    """Conditions that a test changes between two pictures."""

    def __init__(self, **changes: Any) -> None:
        self.now = conditions(**changes)

    def __call__(self) -> Conditions:
        return self.now

    def opened(self, stop: threading.Event | None = None) -> SyntheticSource:
        return SyntheticSource((96, 72), 5, self, stop=stop)


def test_at_another_rate_the_scene_goes_on_at_its_own_speed() -> None:
    changing = Changing(rate_hz=10.0)
    opened = changing.opened()
    before = taken(opened, 4)
    changing.now = conditions(rate_hz=2.0)
    after = taken(opened, 3)
    due_s = [picture.due_s for picture in before + after]
    assert due_s == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.8, 1.3, 1.8])
    assert opened.rate_hz == 2.0
    # Frame 13 of the scene at 10 Hz is at 1.3 s too.
    assert after[1].truth == Scene(96, 72, rate_hz=10.0, seed=5, objects=4).truth(13)


def test_the_first_picture_may_have_another_rate_than_the_source_was_opened_with() -> None:
    changing = Changing(rate_hz=10.0)
    opened = changing.opened()
    changing.now = conditions(rate_hz=2.0)
    assert [picture.due_s for picture in taken(opened, 3)] == [0.0, 0.5, 1.0]


def test_noise_and_objects_change_in_the_scene_that_is_shown() -> None:
    changing = Changing(noise=2.0)
    opened = changing.opened()
    taken(opened, 30)
    changing.now = conditions(noise=0.0)
    (quiet,) = taken(opened, 1)
    expected, truth = Scene(96, 72, 10.0, seed=5, noise=0.0, objects=4).frame(30)
    assert np.array_equal(pixels_of(quiet), expected)
    assert quiet.truth == truth != ()
    changing.now = Conditions(10.0, noise=0.0, objects=0)
    (empty,) = taken(opened, 1)
    assert np.array_equal(pixels_of(empty), Scene(96, 72, seed=5).background())


def test_a_fault_from_now_on_begins_with_the_next_frame_and_is_not_begun_again() -> None:
    changing = Changing(noise=0.0)
    opened, plain = changing.opened(), source(noise=0.0)
    taken(opened, 3)
    changing.now = conditions("lighting@now+2", noise=0.0)
    lit = taken(opened, 2)
    changing.now = conditions("lighting@now+2", noise=0.0, rate_hz=10.0)
    (dark,) = taken(opened, 1)
    normal = taken(plain, 6)[3:]
    brighter = [
        float(pixels_of(one).mean()) > 1.2 * float(pixels_of(other).mean())
        for one, other in zip([*lit, dark], normal, strict=True)
    ]
    assert brighter == [True, True, False]


def test_a_stall_ends_when_its_fault_is_taken_away() -> None:
    changing = Changing(faults="stall@now+999999")

    class Impatient(RecordedWaits):
        def wait(self, timeout: float | None = None) -> bool:
            if len(self.waits_s) == 5:
                changing.now = conditions()
            return super().wait(timeout)

    opened = changing.opened(Impatient())
    # 6 waits of 0.05 s are 3 frames at 10 Hz; the next frame that is due is frame 3.
    assert frame_numbers(taken(opened, 2)) == [3, 4]


def test_it_knows_when_the_next_picture_is_due_and_draws_it_by_what_holds_then() -> None:
    changing = Changing(noise=0.0)
    opened = changing.opened()
    assert isinstance(opened, KnowsNextDue)
    taken(opened, 5)
    assert [opened.next_due_s(), opened.next_due_s()] == pytest.approx([0.5, 0.5])
    changing.now = conditions("drop@now+3,lighting@8+1", noise=0.0)
    assert opened.next_due_s() == pytest.approx(0.8)
    changing.now = conditions(rate_hz=2.0, noise=0.0)
    # The drop is taken back, and the next picture follows that of 0.4 s at the new rate.
    assert opened.next_due_s() == pytest.approx(0.9)
    (picture,) = taken(opened, 1)
    assert picture.due_s == pytest.approx(0.9)
    expected, _ = Scene(96, 72, 10.0, seed=5, noise=0.0, objects=4).frame(9)
    assert np.array_equal(pixels_of(picture), expected)


def numbers(faults: str, count: int) -> list[int | None]:
    """The numbers in the first pictures of a source with these faults."""
    found = Conditions(10.0, faults=parse_faults(faults), numbered=True)
    opened = SyntheticSource((96, 72), 5, lambda: found, stop=RecordedWaits())
    return [read_number(pixels_of(picture)) for picture in taken(opened, count)]


def test_the_number_counts_the_pictures_and_not_what_is_left_out_between_them() -> None:
    assert numbers("drop@3+4,stall@9+2,lighting@12+2", 9) == list(range(9))


def test_a_frozen_picture_shows_the_number_of_the_one_that_it_repeats() -> None:
    assert numbers("frozen@3+3", 8) == [0, 1, 2, 3, 3, 3, 6, 7]


def test_without_being_asked_for_there_is_no_number() -> None:
    assert read_number(pixels_of(taken(source(), 1)[0])) is None


def test_numbers_can_be_had_from_any_picture_on() -> None:
    changing = Changing()
    opened = changing.opened()
    taken(opened, 2)
    changing.now = Conditions(10.0, numbered=True)
    assert [read_number(pixels_of(one)) for one in taken(opened, 2)] == [2, 3]


def test_a_closed_source_says_that_nothing_is_due() -> None:
    opened = source()
    assert opened.next_due_s() == 0.0
    opened.close()
    assert opened.next_due_s() is None


def test_the_scene_changes_between_colours_and_depth_while_it_is_open():
    now = [Conditions(10.0)]
    opened = SyntheticSource((96, 72), 5, lambda: now[0])
    coloured = taken(opened, 1)[0]
    now[0] = Conditions(10.0, depth=True)
    deep = taken(opened, 1)[0]
    assert (coloured.encoding, pixels_of(coloured).dtype) == ("bgr8", np.uint8)
    assert (deep.encoding, pixels_of(deep).dtype) == ("16UC1", np.uint16)
    assert (pixels_of(deep) == Scene(96, 72, 10.0, 5).depth(1)[0]).all()
    assert deep.truth == Scene(96, 72, 10.0, 5).truth(1)


def test_a_frozen_picture_of_depth_is_a_new_one_after_the_change_to_colours():
    now = [Conditions(10.0, faults=parse_faults("frozen@0+5"), depth=True)]
    opened = SyntheticSource((96, 72), 5, lambda: now[0])
    first, second = taken(opened, 2)
    assert (pixels_of(first) == pixels_of(second)).all()
    now[0] = Conditions(10.0, faults=now[0].faults)
    assert pixels_of(taken(opened, 1)[0]).dtype == np.uint8
