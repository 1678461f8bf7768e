"""The synthetic scene: the picture, at any size, and the same for the same seed."""

from __future__ import annotations

import hashlib
import sys

import cv2
import numpy as np
import pytest

from tests.support.processes import run_program
from zv.camera.synthetic.frame_code import extent
from zv.camera.synthetic.scene import Scene

RATE_HZ = 30.0
MINUTE = 1800  # frames


def digest(scene: Scene, k: int) -> str:
    pixels, truth = scene.frame(k)
    return hashlib.sha256(pixels.tobytes() + repr(truth).encode()).hexdigest()


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
    run = run_program([sys.executable, "-c", program])
    assert run.stdout.strip() == digest(Scene(160, 120, seed=4), 250)


def test_another_seed_is_another_scene() -> None:
    assert not np.array_equal(Scene(160, 120, seed=1).background(),
                              Scene(160, 120, seed=2).background())  # fmt: skip
    one, two = (Scene(160, 120, seed=seed) for seed in (1, 2))
    frames = range(0, MINUTE, 60)
    assert [one.truth(k) for k in frames] != [two.truth(k) for k in frames]


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
