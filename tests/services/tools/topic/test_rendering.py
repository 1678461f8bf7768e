"""Fields as text, as one value, as comma-separated values."""

from __future__ import annotations

import csv
import io

import pytest

from services.tools.topic.rendering import NoSuchField, csv_line, flat, lines_of, pick

MESSAGE = {
    "header": {"camera": "front", "seq": 7},
    "x": 3,
    "box": [1, 2, 30, 40],
    "world": None,
    "tracks": [{"id": 1, "v": [0.5, 1.0]}, {"id": 4, "v": []}],
    "counters": {"dropped.stale": 9, "pending": 0},
}


def test_fields_are_shown_one_a_line_and_nested_ones_indented():
    assert list(lines_of(MESSAGE)) == [
        "header:",
        "  camera: front",
        "  seq: 7",
        "x: 3",
        "box: [1, 2, 30, 40]",
        "world: null",
        "tracks:",
        "  - id: 1",
        "    v: [0.5, 1.0]",
        "  - id: 4",
        "    v: []",
        "counters:",
        "  dropped.stale: 9",
        "  pending: 0",
    ]


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("x", 3),
        ("header.seq", 7),
        ("box.2", 30),
        ("tracks.id", [1, 4]),
        ("tracks.0.v.1", 1.0),
        ("counters.dropped.stale", 9),
        ("world.x", None),
    ],
)
def test_a_field_is_found_by_its_dotted_name(path, value):
    assert pick(MESSAGE, path.split(".")) == value


@pytest.mark.parametrize(
    ("path", "known"),
    [
        ("y", list(MESSAGE)),
        ("header.sequence", ["camera", "seq"]),
        ("box.4", ["0 to 3"]),
        ("tracks.name", ["id", "v"]),
        ("x.y", ["none: it is 3"]),
    ],
)
def test_a_field_that_is_not_there_names_those_that_are(path, known):
    with pytest.raises(NoSuchField) as caught:
        pick(MESSAGE, path.split("."))
    assert caught.value.known == known


def test_flat_fields_have_dotted_names():
    assert flat({"a": {"b": {"c": 1}, "d": [2, 3]}, "e": None}) == {
        "a.b.c": 1,
        "a.d": [2, 3],
        "e": None,
    }


def test_a_line_of_values_is_what_a_reader_of_csv_understands():
    line = csv_line([1, None, "a,b", 'say "x"', [1, 2], 0.5])
    assert next(csv.reader(io.StringIO(line))) == ["1", "", "a,b", 'say "x"', "[1, 2]", "0.5"]
