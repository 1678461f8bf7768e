"""Ground truth is read, boxes are made of it, and fit and ignored boxes count, as they should."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from benchmarks.quality.tracker.boxes import METHODS, Faults, Labels, found_by
from benchmarks.quality.tracker.clips import Clip
from benchmarks.quality.tracker.counting import counted, true_counts
from benchmarks.quality.tracker.scoring import Scorer, overlaps, without_ignored
from benchmarks.quality.tracker.sequence import START_NS, Shot, dropped, every, read_mot


def test_row_frame_n_is_the_picture_with_index_n_minus_1(tmp_path: Path):
    path = tmp_path / "gt.txt"
    path.write_text(
        "1,9,499.5,157,31,75,1,-1,-1,-1\n\n3,9,1,2,3,4,1,-1,-1,-1\n3,2,5,6,7,8,0,1,1,1\n"
    )
    assert read_mot(path) == {0: {9: (499.5, 157, 31, 75)}, 2: {9: (1, 2, 3, 4)}}


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("2,9,499.5,157,31", "line 2: not a row"),
        ("2,9,x,1,2,3,1", "line 2: not a row"),
        ("1,9,1,2,3,4,1", "id 9 twice"),
    ],
)
def test_a_truth_that_cannot_be_meant_is_refused_with_its_line(tmp_path: Path, row: str, said: str):
    path = tmp_path / "gt.txt"
    path.write_text(f"1,9,499.5,157,31,75,1,-1,-1,-1\n{row}\n")
    with pytest.raises(ValueError, match=said):
        read_mot(path)


def test_overlaps_are_intersection_over_union():
    one = [(0.0, 0.0, 10.0, 10.0)]
    others = [(5.0, 0.0, 10.0, 10.0), (0.0, 0.0, 10.0, 10.0), (30.0, 0.0, 1.0, 1.0)]
    # Moved by half: 50 common, 150 together.
    assert overlaps(one, others)[0] == pytest.approx([1 / 3, 1, 0])
    assert overlaps(one, []).shape == (1, 0)


def test_a_box_on_an_ignored_object_counts_neither_way():
    truth, ignored = [(0.0, 0.0, 10.0, 20.0)], [(100.0, 0.0, 10.0, 20.0), (1.0, 0.0, 10.0, 20.0)]
    found = {
        1: (0.0, 0.0, 10.0, 20.0),  # overlaps an ignored one too, but fits the truth better
        2: (101.0, 0.0, 10.0, 20.0),
        3: (105.0, 15.0, 10.0, 20.0),  # hardly touches the ignored one: a false box
    }
    assert set(without_ignored(found, truth, ignored)) == {1, 3}


def test_fit_is_the_share_of_frames_with_objects_whose_centroid_fits_one():
    scorer = Scorer()
    person = (0.0, 0.0, 10.0, 20.0)
    scorer.add(0, {1: person}, [], {}, person)
    scorer.add(1, {1: person}, [], {}, (0.0, 0.0, 10.0, 10.0))  # IoU is exactly a half: it fits
    scorer.add(2, {1: person}, [], {}, (0.0, 0.0, 10.0, 9.0))
    scorer.add(3, {1: person}, [], {}, None)
    scorer.add(4, {}, [], {}, person)  # nobody there: does not count
    assert list(scorer.fits.values()) == [True, True, False, False]


def test_dropping_leaves_out_the_same_frames_each_time_and_keeps_number_and_stamp():
    picture = np.zeros((2, 2, 3), np.uint8)
    shots = [Shot(index, picture, START_NS + index, {}) for index in range(1000)]
    kept = list(dropped(lambda: iter(shots), 0.3)())
    assert [one.index for one in kept] == [s.index for s in dropped(lambda: iter(shots), 0.3)()]
    assert all(one.stamp_ns == START_NS + one.index for one in kept)
    # Binomial with n = 1000, p = 0.7: the deviation is 14.5, so that 4 of them are 58.
    assert len(kept) == pytest.approx(700, abs=58)
    assert [one.index for one in every(lambda: iter(shots), 300)()] == [0, 300, 600, 900]


TRUTH = {
    index: {1: (10.0 + 3 * index, 50.0, 40.0, 90.0), 2: (400.0, 100.0, 40.0, 90.0)}
    for index in range(200)
}
WALK = Labels("walk", (640, 480), 25.0, TRUTH, {}, 200)


def test_the_same_seed_makes_the_same_boxes_and_another_makes_others():
    one, same, other = (list(found_by(WALK, Faults(), seed)) for seed in (1, 1, 2))
    assert one == same != other


def test_misses_and_false_boxes_are_as_frequent_as_wanted():
    # A run of misses lasts 2 pictures on average and begins so often that a tenth is missed.
    found = list(found_by(WALK, Faults(jitter=0.0, missed=0.1, gap=2.0, false=0.0), 1))
    missed = 1 - sum(map(len, found)) / 400
    assert 0.05 < missed < 0.2
    found = list(found_by(WALK, Faults(missed=0.0, false=0.5), 1))
    extra = np.mean([len(each) - 2 for each in found])
    assert 0.4 < extra < 1.2  # half of them stay for up to 3 pictures


def test_every_method_follows_two_objects_that_are_always_found():
    for make in METHODS.values():
        method = make(WALK)
        perfect = found_by(WALK, Faults(0.0, 0.0, 1.0, 0.0, 0.95), 1)
        tracks = [method.update(found, index) for index, found in enumerate(perfect)]
        assert all(set(boxes) == {1, 2} for boxes in tracks[3:])


SIZE = (160, 120)


@pytest.fixture(scope="module")
def clip() -> Clip:
    """Return 8 s at 20 Hz, in which one object goes to the right and back, another one left."""
    rough = np.random.default_rng(4).integers(60, 150, (12, 16, 3)).astype(np.uint8)
    pictures = np.repeat(rough.repeat(10, 0).repeat(10, 1)[None], 160, axis=0)
    truth: dict[int, dict[int, tuple[float, float, float, float]]] = {}
    for index in range(40, 160):
        first = 2.0 * (index - 40) if index < 100 else 2.0 * (160 - index)
        for identity, x, y in ((1, first, 15), (2, 130 - (index - 40), 75)):
            left = round(x)
            if 0 <= left <= SIZE[0] - 20:
                pictures[index, y : y + 30, left : left + 20] = (20, 20, 220)
                truth.setdefault(index, {})[identity] = (left, y, 20, 30)
    return Clip("painted", pictures, SIZE, 20.0, 0, truth, {})


def test_the_truth_counts_each_way_over_the_line(clip: Clip):
    """Seen downwards, the larger x are on the left."""
    assert true_counts(clip) == Counter(left=1, right=2)


@pytest.mark.parametrize("lost", [0.0, 0.4])
def test_the_events_count_what_crosses_and_nothing_else(clip: Clip, lost: float):
    assert counted(clip, 1, lost, 1) == true_counts(clip)
