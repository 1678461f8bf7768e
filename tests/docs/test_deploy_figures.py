"""The tables of docs/deploy.md: what a benchmark prints, arithmetic that holds, limits that fit."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from benchmarks.bandwidth import QUALITIES, frames_per_mbit, kilobytes, scene
from benchmarks.memory import SIZES
from tests.support.processes import ROOT
from tests.support.viewer.pages import Page
from zenoh_vision.transport.zenoh_config import (
    WAIT_BEFORE_CLOSE,
    WAIT_BEFORE_CLOSE_US,
    router_config,
)

DEPLOY = Page("docs/deploy.md")
PAGE = DEPLOY.text
MIB = 1024**2


def table(title: str) -> dict[str, list[str]]:
    """Return the rows of the table whose heading begins so, by their first cell."""
    body = re.search(rf"^\| {re.escape(title)}.*\n\|[-|]+\n((?:\|.*\n)+)", PAGE, re.MULTILINE)[1]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in body.splitlines()]
    return {row[0]: row[1:] for row in rows}


BANDWIDTH = table("frame | quality")
MEMORY = table("frame | router")


def pair(cell: str) -> tuple[float, float]:
    size, frames = re.fullmatch(r"([\d.]+) kB, ([\d.]+)", cell).groups()
    return float(size), float(frames)


def test_the_heading_names_the_qualities():
    names = " | ".join(f"quality {quality}" for quality in QUALITIES)
    assert f"| frame | {names} |" in PAGE


@pytest.mark.parametrize("size", ["320x240", "640x480", "1280x720"])
def test_the_sizes_are_what_the_synthetic_camera_makes(size):
    width, height = map(int, size.split("x"))
    shown = [pair(cell)[0] for cell in BANDWIDTH[size]]
    assert shown == pytest.approx(kilobytes(scene(width, height)), rel=0.03)


@pytest.mark.parametrize("size", BANDWIDTH)
def test_frames_a_second_follow_from_the_size(size):
    for cell in BANDWIDTH[size]:
        kilo, frames = pair(cell)
        # 1 Mbit/s are 125 kB/s, of which 1 / 1.06 is picture; two digits are shown.
        assert frames == pytest.approx(125 / kilo / 1.06, rel=0.06)
        assert frames == pytest.approx(frames_per_mbit(kilo), rel=0.06)


def test_the_examples_arithmetic_is_that_of_the_table():
    _, frames = pair(BANDWIDTH["640x480"][QUALITIES.index(80)])
    assert f"30 / {frames:g} = {30 / frames:.1f} Mbit/s" in PAGE
    assert f"2 x {frames:g} = {2 * frames:g} a second" in PAGE
    assert f"640x480 at 30 Hz is {640 * 480 * 24 * 30 / 1e6:.0f} Mbit/s" in PAGE
    assert f"zv param set camera_door rate={2 * frames:g} " in PAGE


def test_the_limits_of_memory_are_enough_for_the_sizes_said():
    limits = {re.search(r"MemoryMax=(\d+)M", unit.read_text())[1] for unit in units()}
    compose = (ROOT / "docker-compose.yml").read_text()
    limits.add(re.search(r"\$\{ZV_MEMORY:-(\d+)m\}", compose)[1])
    assert limits == {"512"}
    raised = {int(found) for found in re.findall(r"(?:ZV_MEMORY=|MemoryMax=)(\d+)[mM]", PAGE)}
    assert list(MEMORY) == list(SIZES)
    most = {size: max(map(int, row)) * 1e6 for size, row in MEMORY.items()}
    *up_to_full_hd, largest = SIZES
    assert all(most[size] < 0.8 * 512 * MIB for size in up_to_full_hd)
    assert 512 * MIB < most[largest] < 0.9 * min(raised) * MIB


def units() -> list[Path]:
    return sorted((ROOT / "examples" / "systemd").glob("*.service"))


def test_the_file_for_slow_links_sets_what_the_page_says(tmp_path):
    (shown,) = [text for text in DEPLOY.blocks("json5") if "wait_before" in text]
    (tmp_path / "router.json5").write_text(shown)
    config = router_config("tcp/127.0.0.1:0", str(tmp_path / "router.json5"))
    assert json.loads(config.get_json(WAIT_BEFORE_CLOSE)) == 4_000_000
    assert "must pass within a second" in PAGE
    assert WAIT_BEFORE_CLOSE_US == 1_000_000
