"""The comparison's page says what was measured."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import av
import numpy as np
import pytest

from benchmarks import page as page_file
from benchmarks.peers import comparison, report
from benchmarks.peers.comparison import Row
from benchmarks.peers.contest import Outcome
from benchmarks.peers.systems import (
    OUR_READING,
    READING,
    ROS_RAW,
    SHARED_MEMORY,
    System,
    systems,
)

SIZE = (768, 576)


def row(name: str, quality: int | None, *rounds: list[float], ours: bool = False) -> Row:
    def run(*_: object) -> Outcome:
        raise AssertionError

    outcomes = [Outcome(tuple(ages), 2.0, 0.25, 100.0) for ages in rounds]
    return Row(System(name, run, jpeg=quality is not None, ours=ours), SIZE, quality, outcomes)


def test_the_percentiles_are_those_of_all_rounds():
    found = row("one", 80, [1.0, 2.0], [3.0, 4.0, 10.0])
    assert found.p50_ms == 3.0
    assert found.p99_ms == pytest.approx(9.76)  # 0.96 of the way from 4 to 10
    assert (found.cpu_ms, found.between_ms, found.memory_mb) == (2.0, 0.25, 100.0)


def test_the_table_has_a_line_for_each_row_the_fastest_first():
    rows = [
        row("raw", None, [1.0]),
        row("slow", 80, [5.0]),
        row("mine", 80, [4.0], ours=True),
        row("fine", 95, [3.0]),
    ]
    assert report.table(rows, SIZE).splitlines()[2:] == [
        "| **mine, quality 80** | 4.00 | 4.00 | 2.00 | 0.25 | 100 |",
        "| slow, quality 80 | 5.00 | 5.00 | 2.00 | 0.25 | 100 |",
        "| fine, quality 95 | 3.00 | 3.00 | 2.00 | 0.25 | 100 |",
        "| raw | 1.00 | 1.00 | 2.00 | 0.25 | 100 |",
    ]
    assert report.table(rows, (1, 1)) == report.HEAD.format(size="1x1")


def costs(system: System, cpu_ms: float, between_ms: float = 0.25) -> Row:
    return Row(system, SIZE, None, [Outcome((1.5,), cpu_ms, between_ms, 100.0)])


def test_reading_comes_first_in_the_table_has_no_age_and_is_not_in_the_plot():
    rows = [row("mine", 80, [4.0]), costs(READING, 1.25, 0.0)]
    assert report.table(rows, SIZE).splitlines()[2:] == [
        "| reading the video, OpenCV |  |  | 1.25 |  | 100 |",
        "| mine, quality 80 | 4.00 | 4.00 | 2.00 | 0.25 | 100 |",
    ]
    assert "OpenCV" not in report.plot(rows, SIZE)


def test_the_ratio_to_ros_is_said_with_and_without_reading():
    # 3 / 6 = 0.5, and (3 - 1.5) / (6 - 1) = 0.3.
    rows = [costs(READING, 1.0), costs(OUR_READING, 1.5), costs(SHARED_MEMORY, 3.0)]
    assert report.without_reading(rows, SIZE) == ""
    rows.append(costs(ROS_RAW, 6.0))
    assert report.without_reading(rows, SIZE) == (
        "Shared memory costs 0.50 of the CPU time of ROS 1, raw (3.00 of 6.00 ms a frame). "
        "Without the reading of the video it is 0.30 (1.50 of 5.00 ms)."
    )
    assert report.without_reading(rows, (1, 1)) == ""


def test_the_plot_names_every_row_and_is_xml():
    plot = report.plot([row("a & b", 80, [5.0]), row("mine", None, [4.0], ours=True)], SIZE)
    words = [each.text for each in ElementTree.fromstring(plot).iter() if each.text]
    assert "a & b, quality 80" in words
    assert "mine" in words


def test_the_page_is_written_with_its_plots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(page_file, "PAGE", tmp_path / "performance.md")
    monkeypatch.setattr(page_file, "PLOTS", tmp_path / "images")
    report.write_page([row("mine", 80, [4.0], ours=True)])
    page = (tmp_path / "performance.md").read_text()
    assert "**mine, quality 80**" in page
    assert "{" not in page
    assert sorted(path.name for path in (tmp_path / "images").iterdir()) == [
        "1920x1080.svg",
        "768x576.svg",
    ]


def test_every_system_says_what_is_missing_or_can_run():
    for system in systems():
        assert "install" in (system.missing() or "install"), system.name


def test_the_clip_is_a_video_of_30_hz_that_goes_forth_and_back_for_the_time_asked(tmp_path: Path):
    pictures = [np.full((48, 64, 3), level, np.uint8) for level in (20, 120, 220)]
    comparison.write_clip(tmp_path / "a.mp4", pictures, 5 / 30)
    with av.open(str(tmp_path / "a.mp4")) as container:
        stream = container.streams.video[0]
        shown = [frame.to_ndarray(format="gray").mean() for frame in container.decode(stream)]
        assert stream.average_rate == 30
    assert shown == pytest.approx([20, 120, 220, 120] * 2, abs=4)
