"""The figures of one node as text."""

import os

import psutil
import pytest

from tests.support.terminal import rendered
from zv.status.process_usage import ProcessUsage
from zv.status.row import Row, drops, line_of, view_of


def test_drops_stand_largest_first_and_what_nobody_wanted_last():
    counters = {
        "received": 9,
        "dropped.stale": 2,
        "dropped.corrupt": 5,
        "dropped.empty": 0,
        "dropped.no_subscriber": 90,
        "missed": 3,
    }
    assert drops(counters) == ("corrupt=5 missed=3 stale=2", "no_subscriber=90")


def test_memory_and_cpu_are_those_of_the_process():
    usage = ProcessUsage()
    usage.begin(os.getpid())
    cpu, memory = usage.read(os.getpid())
    assert cpu is not None
    assert cpu >= 0
    assert memory == pytest.approx(psutil.Process().memory_info().rss / 1e6, abs=20)
    assert usage.read(None) == (None, None)


def test_columns_that_no_node_has_anything_for_are_left_out():
    up = [Row("camera_front", "running", rate="30.0", cpu="5", memory="149")]
    top = [Row("camera_front", "running", rate="30.0", lost="1.5", host="roof")]
    assert "lost %" not in rendered(view_of(up).table())
    assert "host" not in rendered(view_of(up).table())
    assert "lost %" in rendered(view_of(top).table())
    assert "roof" in rendered(view_of(top).table())
    assert line_of(top[0]).endswith("lost 1.5 %  dropped none  on roof")


def test_the_routes_of_a_nodes_frames_have_a_column_if_it_has_any():
    rows = [Row("tracker_front", "running", rate="30.0", route="jpeg,shm"), Row("edge", "running")]
    assert "jpeg,shm" in rendered(view_of(rows).table())
    assert "route" not in rendered(view_of(rows[1:]).table())
    assert line_of(rows[0]).endswith("by jpeg,shm")


def test_what_a_node_says_is_text_and_no_markup():
    row = Row("[red]x[/red]", "running", host="[b]roof", message="[blink]hello")
    shown = rendered(view_of([row]).table())
    assert all(words in shown for words in ("[red]x[/red]", "[b]roof", "[blink]"))


def test_how_far_a_source_is_behind_has_a_column_if_a_camera_knows_it():
    rows = [Row("camera_front", "running", p99="9.0", lag="41.5"), Row("edge", "running")]
    assert "lag ms" in rendered(view_of(rows).table())
    assert "lag ms" not in rendered(view_of(rows[1:]).table())
    assert "lag 41.5 ms" in line_of(rows[0])
