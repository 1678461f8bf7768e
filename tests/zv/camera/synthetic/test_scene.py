"""The synthetic scene: what it shows, and that its truth is true to the pixel."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from dataclasses import replace
from functools import cache
from itertools import combinations, pairwise
from typing import Any

import cv2
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


def digest(scene: Scene, k: int) -> str:
    pixels, truth = scene.frame(k)
    return hashlib.sha256(pixels.tobytes() + repr(truth).encode()).hexdigest()


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
            [one if one.id in shown else replace(one, sprite=NOTHING) for one in placed]
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


def test_every_visible_object_is_confirmed_and_listed_once_in_the_order_of_ids() -> None:
    for tracks in minute_of_truth(1):
        assert [track.id for track in tracks] == sorted({track.id for track in tracks})
        assert {track.state for track in tracks} <= {"confirmed"}


def test_boxes_lie_inside_the_picture() -> None:
    for tracks in minute_of_truth(2):
        for track in tracks:
            x, y, width, height = track.box
            assert width >= 1
            assert height >= 1
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


# --- what happens in it ---


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("which", [1, 2, 3, 4])
def test_every_object_leaves_the_picture_and_returns_within_a_minute(seed: int, which: int) -> None:
    seen = "".join("#" if one else "." for one in of_object(minute_of_truth(seed), which))
    visits = [visit for visit in seen.split("." * 20) if "#" in visit]
    assert len(visits) >= 3


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("which", [1, 2, 3, 4])
def test_every_object_comes_from_both_sides(seed: int, which: int) -> None:
    directions = {np.sign(one.vx) for one in of_object(minute_of_truth(seed), which) if one}
    assert directions == {-1.0, 0.0, 1.0}


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


# --- the picture ---


def test_the_background_is_the_picture_without_objects_and_noise() -> None:
    empty = Scene(160, 120, noise=0.0, objects=0)
    assert np.array_equal(empty.render(17), empty.background())
    assert empty.truth(17) == ()
    assert np.array_equal(empty.background(), Scene(160, 120, objects=5).background())


def test_the_background_is_textured_everywhere_but_not_glaring() -> None:
    room = cv2.cvtColor(Scene(640, 480).background(), cv2.COLOR_BGR2GRAY)
    blocks = room.reshape(15, 32, 20, 32).swapaxes(1, 2).reshape(300, -1)
    assert blocks.std(axis=1).min() > 1.0
    assert room.min() > 40
    assert room.max() < 250


def test_sensor_noise_has_the_deviation_asked_for_and_no_bias() -> None:
    scene = Scene(320, 240, noise=3.0, objects=0)
    noise = scene.render(4).astype(float) - scene.background()
    assert noise.std() == pytest.approx(3.0, rel=0.03)
    assert noise.mean() == pytest.approx(0.0, abs=0.05)


def test_sensor_noise_differs_from_frame_to_frame_and_pixel_to_pixel() -> None:
    scene = Scene(160, 120, noise=2.0, objects=0)
    room = scene.background().astype(float)
    first, second = (scene.render(k) - room for k in (0, 1))
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.03
    assert abs(np.corrcoef(first[:, 1:].ravel(), first[:, :-1].ravel())[0, 1]) < 0.03


def test_more_light_changes_the_picture_and_not_the_truth() -> None:
    scene = Scene(160, 120, noise=0.0)
    plain, truth = scene.frame(100)
    bright, same_truth = scene.frame(100, gain=1.2)
    expected = np.clip(np.rint(plain * 1.2), 0, 255)
    assert np.abs(bright - expected).max() <= 1
    assert truth == same_truth


@pytest.mark.parametrize(
    "size", [(16, 16), (64, 48), (48, 64), (1000, 64), (641, 481), (1920, 1080)], ids=str
)
def test_any_size_has_a_picture_and_visible_objects(size: tuple[int, int]) -> None:
    width, height = size
    scene = Scene(width, height)
    seen = set()
    for k in range(0, 600, 60):
        pixels, truth = scene.frame(k)
        assert pixels.shape == (height, width, 3)
        assert pixels.dtype == np.uint8
        seen |= {track.id for track in truth}
    assert seen == {1, 2, 3, 4}


def test_objects_grow_with_the_picture() -> None:
    small, large = (
        {track.id: track for track in Scene(*size).truth(115)}[2].box
        for size in ((160, 120), (640, 480))
    )
    assert [side / 4 for side in large] == pytest.approx(small, abs=1.01)


@pytest.mark.parametrize("objects", [0, 1, 4, 16])
def test_so_many_objects_appear_as_were_asked_for(objects: int) -> None:
    scene = Scene(160, 120, objects=objects)
    seen = {track.id for k in range(0, MINUTE, 5) for track in scene.truth(k)}
    assert seen == set(range(1, objects + 1))


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


def test_a_number_is_free_of_light_and_noise() -> None:
    bgr, _ = Scene(160, 120, noise=20.0).frame(5, gain=1.35, number=5)
    width, height = extent(160, 120)
    assert set(np.unique(bgr[:height, :width])) == {0, 255}


# --- the same again ---


def test_frame_k_is_the_same_in_any_order_and_in_another_scene() -> None:
    order = [3, 250, 40, 0, 999]
    one, other = Scene(160, 120, seed=4), Scene(160, 120, seed=4)
    forwards = {k: digest(one, k) for k in sorted(order)}
    assert {k: digest(other, k) for k in order} == forwards
    assert {k: digest(one, k) for k in order} == forwards


def test_frame_k_is_the_same_in_another_process() -> None:
    program = (
        "import hashlib\n"
        "from zv.camera.synthetic.scene import Scene\n"
        "pixels, truth = Scene(160, 120, seed=4).frame(250)\n"
        "print(hashlib.sha256(pixels.tobytes() + repr(truth).encode()).hexdigest())\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60
    )
    assert run.stdout.strip() == digest(Scene(160, 120, seed=4), 250)


def test_another_seed_is_another_scene() -> None:
    assert not np.array_equal(Scene(160, 120, seed=1).background(),
                              Scene(160, 120, seed=2).background())  # fmt: skip
    assert minute_of_truth(1) != minute_of_truth(2)


def test_changing_a_picture_does_not_change_the_scene() -> None:
    scene = Scene(160, 120)
    before = digest(scene, 90)
    scene.render(90)[:] = 0
    scene.background()[:] = 0
    assert digest(scene, 90) == before


def test_a_depth_camera_sees_the_room_and_each_object_at_its_distance():
    scene = Scene(640, 480, RATE_HZ, noise=0.0)
    background, _ = Scene(640, 480, RATE_HZ, noise=0.0, objects=0).depth(0)
    # The floor is at 2 m * (1 - 0.22) / (y / 480 - 0.22), with y the middle of a row.
    assert background[479, 0] == round(2000 * 0.78 / (479.5 / 480 - 0.22))
    assert background[300, 639] == round(2000 * 0.78 / (300.5 / 480 - 0.22))
    assert (background[:241] == background[0, 0]).all()  # the wall
    assert (np.diff(background[240:, 0].astype(int)) < 0).all()

    depth, truth = scene.depth(100)
    nearer = depth < background
    assert (depth[~nearer] == background[~nearer]).all()
    for track in truth:
        x, y, width, height = track.box
        assert nearer[y : y + height, x : x + width].any()
    assert nearer.sum() <= sum(track.area for track in truth)


def test_the_noise_of_a_depth_camera_is_4_mm_for_each_grey_level():
    still, noisy = (Scene(320, 240, RATE_HZ, noise=noise, objects=0) for noise in (0.0, 2.0))
    difference = noisy.depth(7)[0].astype(int) - still.depth(7)[0]
    assert abs(difference.mean()) < 0.2
    assert difference.std() == pytest.approx(8.0, rel=0.05)
