"""How fast costs grow is calculated rightly, and the page says it."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from benchmarks import page
from benchmarks.growth import measuring, report
from benchmarks.growth.fit import exponent, grows_faster
from benchmarks.growth.measuring import Point
from benchmarks.growth.report import Growth
from benchmarks.system import System

WORKS = (1, 2, 4, 8, 16, 32)


@pytest.mark.parametrize("power", [0.0, 0.5, 1.0, 2.0])
def test_the_exponent_is_that_of_a_power_law(power: float):
    costs = [7.0 * work**power for work in WORKS]
    assert exponent(WORKS, costs) == pytest.approx(power, abs=1e-9)


def test_the_last_three_points_are_fitted_by_least_squares():
    # In logarithms to base 2: x = 0, 1, 2 and y = 0, 0, 3, so the slope is
    # ((0 - 1)(0 - 1) + (2 - 1)(3 - 1)) / 2 = 1.5.
    assert exponent((0.25, 0.5, 1, 2, 4), (9, 9, 1, 1, 8)) == pytest.approx(1.5)


def test_what_a_process_costs_without_work_does_not_hide_growth():
    quadratic = [10 + 0.1 * work**2 for work in WORKS]
    linear = [10 + 1.0 * work for work in WORKS]
    # At 8, 16 and 32: 16.4, 35.6 and 112.4, whose ends are a factor of 6.85 apart while the work is
    # 4 times as much: ln 6.85 / ln 4 = 1.388. And 18, 26 and 42: ln 2.333 / ln 4 = 0.611.
    assert exponent(WORKS, quadratic) == pytest.approx(1.388, abs=1e-3)
    assert exponent(WORKS, linear) == pytest.approx(0.611, abs=1e-3)
    assert grows_faster(WORKS, quadratic)
    assert not grows_faster(WORKS, linear)


def test_noise_of_some_per_cent_is_no_growth():
    factors = (1.0, 0.97, 1.04, 0.97, 1.03, 1.04)
    costs = [12 * work * factor for work, factor in zip(WORKS, factors, strict=True)]
    assert not grows_faster(WORKS, costs)


def growth(power: float = 1.0, *, work: str = "cameras", works: tuple[int, ...] = WORKS) -> Growth:
    points = [
        Point(each, {"camera": 10.0 * each, "router": 2.0 * each**power}, 1.5, 3.25, 0.995)
        for each in works
    ]
    return Growth(work, f"Many {work}", work, "ms a second", points)


def test_the_verdict_names_what_grows_faster_and_says_the_cost_at_both_ends():
    assert report.verdict(growth()) == (
        "No cost grows faster than the cameras (no exponent above 1.1). For one of the cameras, "
        "at 1 and at 32, ms a second: camera 10.00 and 10.00, router 2.00 and 2.00."
    )
    assert report.verdict(growth(2.0)).startswith(
        "**Faster than the cameras grows the cost of: router.** "
    )
    busy = growth(2.0)
    points = [*busy.points[:-1], replace(busy.points[-1], share=0.5)]
    assert report.verdict(replace(busy, points=points)).startswith(
        "Not judged, as the machine was too busy: of the frames, 50 % at 32 were decoded."
    )
    pixels = growth(work="pixels", works=(19_200, 76_800, 307_200))
    assert "For a megapixel, at 160x120 and at 640x480" in report.verdict(pixels)
    assert "router 2000000.00 and 2000000.00" in report.verdict(pixels)


def test_the_table_ends_with_the_exponents():
    lines = report.table(growth(2.0)).splitlines()
    assert lines[0] == (
        "| cameras | camera, ms a second | router, ms a second | p50, ms | p99, ms | decoded |"
    )
    assert lines[2] == "| 1 | 10.00 | 2.00 | 1.5 | 3.2 | 100 % |"
    assert lines[-1] == "| exponent | 1.00 | 2.00 | | | |"


def test_the_plot_shows_each_point_and_is_xml():
    root = ElementTree.fromstring(report.plot(growth()))
    words = [each.text for each in root.iter() if each.text]
    assert {"camera", "router", "as the work", "p50", "p99", "32"} <= set(words)
    circles = [each for each in root.iter() if each.tag.endswith("circle")]
    assert len(circles) == 4 * len(WORKS)
    # Six works over 330 pixels from 60 on, each twice the one before: 66 apart.
    assert [float(each.get("cx")) for each in circles[:6]] == pytest.approx(
        [60, 126, 192, 258, 324, 390]
    )
    # 10 to 320 of camera, on an axis from 1 to 1000 over 250 pixels, downwards from 40.
    assert float(circles[0].get("cy")) == pytest.approx(290 - 250 / 3, abs=0.1)


def test_each_part_of_the_page_is_replaced_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(page, "PAGE", tmp_path / "performance.md")
    monkeypatch.setattr(page, "PLOTS", tmp_path / "images")
    page.write_part("peers", r"a \1 table")
    report.write_page([growth()])
    page.write_part("peers", "another table")
    text = (tmp_path / "performance.md").read_text()
    assert text.startswith(
        "<!-- peers -->\nanother table\n\n<!-- end of peers -->\n<!-- growth -->"
    )
    assert "### Many cameras\n\nNo cost grows faster" in text
    assert "{" not in text
    assert (tmp_path / "images" / "cameras.svg").exists()


def test_the_clock_of_a_process_counts_what_it_uses():
    """A loop of 0.3 s of its own processor time, and the time of a sleeper, which is none."""
    spin = "import time\nwhile time.process_time() < 0.3: pass\nprint(flush=True); time.sleep(60)"
    with System() as system:
        system.start("spinning", "-c", spin)
        system.begin()
        deadline_s = time.monotonic() + 60
        while system.cpu_s()["spinning"] < 0.25:
            assert time.monotonic() < deadline_s
            time.sleep(0.01)


def test_one_camera_and_one_subscriber_are_measured():
    (point,) = measuring.of_pixels(1.0, [(64, 48)])
    assert point.work == 64 * 48
    assert set(point.cpu_ms) == {"camera", "router", "subscriber"}
    assert min(point.cpu_ms.values()) > 0
    assert 0 < point.p50_ms <= point.p99_ms
    assert point.share > 0
