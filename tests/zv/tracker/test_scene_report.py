"""What the tracker says about pictures in which it cannot work."""

from __future__ import annotations

from zv.tracker.scene_report import SceneReport

SECOND = 1_000_000_000


def test_a_changed_view_is_said_for_3_s():
    report = SceneReport()
    said = [report.update(k * SECOND // 10, "other" if k == 10 else "scene") for k in range(60)]
    assert said[:10] == [""] * 10
    assert all("view has changed" in each for each in said[10:40])
    assert said[40:] == [""] * 20


def test_a_rate_at_which_objects_cannot_be_followed_is_said_and_one_lost_frame_is_not():
    slow, fast = SceneReport(), SceneReport()
    assert "1.0 frames/s" in [slow.update(k * SECOND, "scene") for k in range(5)][-1]
    stamps = [k for k in range(40) if k % 10]
    assert {fast.update(k * SECOND // 10, "scene") for k in stamps} == {""}


def test_stamps_that_stand_still_or_go_back_say_nothing():
    report = SceneReport()
    assert {report.update(at, "scene") for at in (5, 5, 3, 3, 5)} == {""}
