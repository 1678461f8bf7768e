"""The figures of one node as text."""

import os

import psutil
import pytest

from services.figures.display import drawn, line_of
from services.figures.meter import Meter
from services.figures.row import Row, drops
from tests.services.figures.rendering import rendered


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
    meter = Meter()
    meter.begin(os.getpid())
    cpu, memory = meter.read(os.getpid())
    assert cpu is not None
    assert cpu >= 0
    assert memory == pytest.approx(psutil.Process().memory_info().rss / 1e6, abs=20)
    assert meter.read(None) == (None, None)


def test_columns_that_no_node_has_anything_for_are_left_out():
    up = [Row("camera_front", "running", rate="30.0", cpu="5", memory="149")]
    top = [Row("camera_front", "running", rate="30.0", lost="1.5", host="roof")]
    assert "lost %" not in rendered(drawn(up))
    assert "host" not in rendered(drawn(up))
    assert "lost %" in rendered(drawn(top))
    assert "roof" in rendered(drawn(top))
    assert line_of(top[0]).endswith("lost 1.5 %  dropped none  on roof")


def test_what_a_node_says_is_text_and_no_markup():
    row = Row("[red]x[/red]", "running", host="[b]roof", message="[blink]hello")
    assert all(words in rendered(drawn([row])) for words in ("[red]x[/red]", "[b]roof", "[blink]"))
