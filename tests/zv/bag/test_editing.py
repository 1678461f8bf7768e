"""New recordings of others: parts, selections, several in one."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

from tests.zv.bag.records import frame, message, written
from zv.bag.editing import opened, selected, write
from zv.bag.recording import Recording
from zv.bag.report import report_of

STATE = replace(message(0, "camera_info"), origin="query")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    frames = [each for seq in range(1, 60) for each in (frame(seq), message(seq))]
    return written(tmp_path / "run.mcap", [STATE, *frames])


def test_a_part_begins_with_the_state_of_its_start(run: Path, tmp_path: Path) -> None:
    start, end = frame(20).log_time_ns, frame(30).log_time_ns
    with ExitStack() as stack:
        records = selected(opened([run], stack), start_ns=start, end_ns=end)
        assert write(records, tmp_path / "part.mcap", {"made_by": "test"}) == 21
    with Recording(tmp_path / "part.mcap") as part:
        found = list(part.records())
        assert (found[0].key, found[0].payload, found[0].origin) == (
            STATE.key,
            STATE.payload,
            "query",
        )
        assert found[0].log_time_ns == start
        expected = [each for seq in range(20, 30) for each in (frame(seq), message(seq))]
        assert found[1:] == expected
        assert report_of(part).verdict == "complete"
        assert part.about["made_by"] == "test"


def test_several_recordings_become_one_in_order(run: Path, tmp_path: Path) -> None:
    left = written(tmp_path / "left.mcap", [frame(seq, "left") for seq in range(60)])
    with ExitStack() as stack:
        write(selected(opened([run, left], stack)), tmp_path / "both.mcap", {})
    with Recording(tmp_path / "both.mcap") as both:
        found = list(both.records())
        times = [each.log_time_ns for each in found]
        assert times == sorted(times)
        assert len(found) == 1 + 2 * 59 + 60
        assert [each for each in found if "left" in each.key] == [
            frame(seq, "left") for seq in range(60)
        ]
        assert report_of(both).verdict == "complete"


def test_keys_are_kept_and_excluded(run: Path, tmp_path: Path) -> None:
    with ExitStack() as stack:
        recordings = opened([run], stack)
        write(selected(recordings, keys=["vision/*/centroid"]), tmp_path / "a.mcap", {})
        write(selected(recordings, exclude=["vision/*/centroid"]), tmp_path / "b.mcap", {})
    with Recording(tmp_path / "a.mcap") as a, Recording(tmp_path / "b.mcap") as b:
        assert a.keys() == ["vision/front/centroid"]
        assert b.keys() == ["vision/front/camera_info", "vision/front/image/compressed"]


def test_a_gap_in_the_original_is_a_gap_in_the_copy(tmp_path: Path) -> None:
    gap = written(tmp_path / "gap.mcap", [frame(seq) for seq in (0, 1, 5)])
    with ExitStack() as stack:
        write(selected(opened([gap], stack)), tmp_path / "copy.mcap", {})
    with Recording(tmp_path / "copy.mcap") as copy:
        assert report_of(copy).verdict == "3 missed"


def test_what_is_stopped_leaves_no_file(run: Path, tmp_path: Path) -> None:
    def stopped() -> object:
        yield frame(1)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write(stopped(), tmp_path / "x.mcap", {})  # type: ignore[arg-type]
    assert {each.name for each in tmp_path.iterdir()} == {"run.mcap"}
