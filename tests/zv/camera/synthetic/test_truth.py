"""The truth of the synthetic scene: it is true to the pixel, and enough happens in it."""

from __future__ import annotations

from functools import cache
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pytest

from tests.support.pictures.frame_numbers import read_number
from zenoh_vision.messages import Track
from zv.camera.synthetic.frame_code import extent
from zv.camera.synthetic.scene import Scene
from zv.camera.synthetic.sprite import Sprite

RATE_HZ = 30.0
MINUTE = 1800  # frames
NOTHING = Sprite(
    mask=np.zeros((1, 1), np.uint8),
    paint=np.zeros((1, 1, 3), np.uint8),
    keep=np.full((1, 1, 3), 255, np.uint8),
)
SEEDS = (1, 2, 7)

Truths = tuple[tuple[Track, ...], ...]
Mask = np.ndarray[Any, np.dtype[np.bool_]]


@cache
def minute_of_truth(seed: int, width: int = 160, height: int = 120) -> Truths:
    """The truth of the first minute, frame by frame."""
    scene = Scene(width, height, RATE_HZ, seed, noise=0.0)
    return tuple(scene.truth(k) for k in range(MINUTE))


def of_object(truths: Truths, which: int) -> list[Track | None]:
    """One object's track in each frame, None where it cannot be seen."""
    return [next((one for one in tracks if one.id == which), None) for tracks in truths]


def seen_in_pictures(
    scene: Scene, k: int, objects: int
) -> tuple[dict[int, Mask], dict[int, Mask]] | None:
    """Find each object's pixels from noise-free pictures alone.

    An object's own pixels are those that change when it is added to the empty scene. Where two
    objects share pixels, the one in front is the one whose inside looks as if it were alone.

    Returns:
        By id, (height, width) bool: its pixels if it were alone, and those that can be seen.
        None if two objects touch with nothing but their translucent rims, so that pictures
        cannot tell which one is in front.
    """
    everyone = set(range(1, objects + 1))
    placed = scene._placed(k)

    def picture(*shown: int) -> np.ndarray[Any, np.dtype[np.uint8]]:
        # The shadows of the others stay, so that the difference is what an object adds itself.
        return scene._painted(
            [one if one.id in shown else one._replace(sprite=NOTHING) for one in placed]
        )

    nobody = picture()
    single = {which: picture(which) for which in everyone}
    alone = {which: (single[which] != nobody).any(axis=2) for which in everyone}
    seen = {which: pixels.copy() for which, pixels in alone.items()}
    for one, other in combinations(sorted(everyone), 2):
        shared = alone[one] & alone[other]
        if shared.any():
            both = picture(one, other)
            unchanged = {
                which: int((both == single[which]).all(axis=2)[shared].sum())
                for which in (one, other)
            }
            if unchanged[one] == unchanged[other]:
                return None
            seen[min(unchanged, key=lambda which: unchanged[which])] &= ~shared
    return alone, seen


@pytest.mark.parametrize("size", [(160, 120), (321, 200), (64, 48)], ids=str)
def test_truth_is_what_the_pictures_show_of_each_object(size: tuple[int, int]) -> None:
    scene = Scene(*size, RATE_HZ, seed=3, noise=0.0, objects=6)
    frames = range(0, MINUTE, 14)
    hidden_in_part = undecided = 0
    for k in frames:
        found = seen_in_pictures(scene, k, objects=6)
        if found is None:
            undecided += 1
            continue
        alone, seen = found
        truth = {track.id: track for track in scene.truth(k)}
        assert truth.keys() == {which for which, pixels in seen.items() if pixels.any()}
        for which, track in truth.items():
            rows, columns = np.nonzero(seen[which])
            x, y = int(columns.min()), int(rows.min())
            width, height = int(columns.max()) - x + 1, int(rows.max()) - y + 1
            assert track.box == (x, y, width, height)
            assert track.area == len(rows)
            assert (track.x, track.y) == (x + width // 2, y + height // 2)
            hidden_in_part += track.area < 0.8 * alone[which].sum()
    assert hidden_in_part > 3
    assert undecided < 0.2 * len(frames)  # at 64x48 much of an object is rim


def test_a_nearer_object_hides_a_farther_one() -> None:
    # The walker's lane is in front of the cart's.
    one, two = Scene(160, 120, objects=1), Scene(160, 120, objects=2)
    walker = of_object(tuple(one.truth(k) for k in range(900)), 1)
    both = tuple(two.truth(k) for k in range(900))
    assert of_object(both, 1) == walker
    inside = [cart.area for cart in of_object(both, 2) if cart and 20 < cart.x < 140]
    assert min(inside) < 0.8 * max(inside)


def test_truth_needs_no_picture_and_agrees_with_the_frame() -> None:
    scene = Scene(160, 120)
    assert scene.truth(100) == scene.frame(100)[1]
    assert np.array_equal(scene.render(100), scene.frame(100)[0])


def test_visible_objects_are_confirmed_listed_in_the_order_of_ids_and_inside_the_picture() -> None:
    for tracks in minute_of_truth(2):
        assert [track.id for track in tracks] == sorted({track.id for track in tracks})
        for track in tracks:
            x, y, width, height = track.box
            assert track.state == "confirmed"
            assert min(width, height) >= 1
            assert 0 <= x <= x + width <= 160
            assert 0 <= y <= y + height <= 120


def test_velocity_is_how_far_the_object_goes() -> None:
    # The ball is the rigid one: between two frames in which all of it is seen, its box moves by
    # the velocity at the middle, here taken as the mean of both ends. Rounding costs a pixel.
    scene = Scene(640, 480, RATE_HZ, noise=0.0, objects=3)
    track_of = [{track.id: track for track in scene.truth(k)}.get(3) for k in range(MINUTE)]
    compared = 0
    for before, after in zip(track_of, track_of[3:], strict=False):
        if before is None or after is None or before.area != after.area:
            continue
        hops = abs(after.vy - before.vy) > 150 or (before.vx == 0) != (after.vx == 0)
        if hops or before.box[2:] != after.box[2:]:
            continue
        assert (before.vx + after.vx) / 2 * 3 / RATE_HZ == pytest.approx(
            after.box[0] - before.box[0], abs=1.01
        )
        assert (before.vy + after.vy) / 2 * 3 / RATE_HZ == pytest.approx(
            after.box[1] - before.box[1], abs=1.01
        )
        compared += 1
    assert compared > 100


@pytest.mark.parametrize("which", [1, 2, 3, 4])
def test_age_counts_from_the_entry_into_the_picture(which: int) -> None:
    tracks = of_object(minute_of_truth(1), which)
    entries = 0
    for k, (before, now) in enumerate(pairwise(tracks), start=1):
        if now is None:
            continue
        back = tracks[:k][::-1]
        if before is None and all(one is None for one in back[:30]):
            # The first column is seen within some frames of setting off from the edge: a figure
            # that swings its legs fills its sprite only once a step.
            assert 0.0 <= now.age_s < 0.5
            entries += 1
        elif before is not None:
            assert now.age_s - before.age_s == pytest.approx(1 / RATE_HZ)
    assert entries >= 3


def test_a_number_covers_the_corner_and_the_truth_says_what_can_still_be_seen() -> None:
    scene = Scene(160, 120, RATE_HZ, noise=0.0, objects=16)
    width, height = extent(160, 120)
    covered = 0
    for k in range(21, 60, 2):
        found = seen_in_pictures(scene, k, objects=16)
        plain, before = scene.frame(k)
        bgr, truth = scene.frame(k, number=k)
        assert read_number(bgr) == k
        assert np.array_equal(bgr[height:], plain[height:])
        assert np.array_equal(bgr[:, width:], plain[:, width:])
        if found is None:
            continue
        seen = {which: pixels.copy() for which, pixels in found[1].items()}
        for pixels in seen.values():
            pixels[:height, :width] = False
        assert {one.id: one.area for one in truth} == {
            which: pixels.sum() for which, pixels in seen.items() if pixels.any()
        }
        for one in truth:
            rows, columns = np.nonzero(seen[one.id])
            assert one.box[:2] == (columns.min(), rows.min())
        covered += truth != before
    assert covered >= 3


# --- what happens in it ---


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("which", [1, 2, 3, 4])
def test_every_object_comes_from_both_sides_leaves_and_returns(seed: int, which: int) -> None:
    tracks = of_object(minute_of_truth(seed), which)
    visits = "".join("#" if one else "." for one in tracks).split("." * 20)
    assert sum("#" in visit for visit in visits) >= 3
    assert {np.sign(one.vx) for one in tracks if one} == {-1.0, 0.0, 1.0}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("which", [1, 2, 3, 4])
def test_every_object_stands_still_for_a_second_and_a_half(seed: int, which: int) -> None:
    stands: list[list[Track]] = [[]]
    for track in of_object(minute_of_truth(seed), which):
        if track is not None and track.vx == 0.0:
            stands[-1].append(track)
        elif stands[-1]:
            stands.append([])
    longest = max(stands, key=len)
    assert len(longest) >= 1.5 * RATE_HZ
    largest = max(track.area for track in longest)  # nobody passes in front of it then
    assert len({track.box for track in longest if track.area == largest}) == 1
    assert {track.vy for track in longest} == {0.0}


@pytest.mark.parametrize("seed", SEEDS)
def test_a_standing_object_shows_no_change_but_noise(seed: int) -> None:
    scene = Scene(160, 120, RATE_HZ, seed, noise=0.0, objects=1)
    still = [k for k in range(MINUTE) if any(one.vx == 0.0 for one in scene.truth(k))]
    assert np.array_equal(scene.render(still[1]), scene.render(still[10]))


@pytest.mark.parametrize("seed", SEEDS)
def test_objects_cross_one_another_within_half_a_minute(seed: int) -> None:
    truths = minute_of_truth(seed)[:900]
    swaps = set()
    for before, now in zip(truths, truths[15:], strict=False):
        was, is_ = {t.id: t for t in before}, {t.id: t for t in now}
        both = sorted(was.keys() & is_.keys())
        swaps |= {
            (one, other)
            for one in both
            for other in both
            if was[one].x < was[other].x and is_[one].x > is_[other].x
        }
    assert len({frozenset(pair) for pair in swaps}) >= 2


def test_the_largest_moving_object_is_clear_in_most_frames() -> None:
    clear = moving = 0
    for seed in SEEDS:
        for tracks in minute_of_truth(seed):
            areas = sorted((one.area for one in tracks if one.vx), reverse=True)
            moving += bool(areas)
            clear += bool(areas) and (len(areas) == 1 or areas[0] > 1.3 * areas[1])
    assert moving > 0.8 * MINUTE * len(SEEDS)
    assert clear > 0.8 * moving
