"""Polygons and lines in text: parsing, and refusals with their reasons."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zv.tracker import shapes
from zv.tracker.shapes import Line, Polygon, ShapeError


def test_polygons_are_parsed_in_order_with_names_and_units():
    text = "belt 10,10 200,10 200,100;pick world 0,0 0.4,0 .4,-2e-1"
    assert shapes.polygons(text) == (
        Polygon("belt", ((10, 10), (200, 10), (200, 100))),
        Polygon("pick", ((0, 0), (0.4, 0), (0.4, -0.2)), "world"),
    )


def test_lines_are_parsed_in_order_with_names_and_units():
    assert shapes.lines("gate 0,5 10,5\nexit world 1,1 1,2 ;") == (
        Line("gate", (0, 5), (10, 5)),
        Line("exit", (1, 1), (1, 2), "world"),
    )


def test_a_text_of_several_lines_may_have_comments_and_loose_spaces():
    text = """
    # the belt; not the table
    belt  10 , 10  200,10
    """
    assert shapes.lines(text) == (Line("belt", (10, 10), (200, 10)),)


@pytest.mark.parametrize("text", ["", "  ", ";;", "\n# nothing\n"])
def test_an_empty_text_has_no_shapes(text: str):
    assert shapes.polygons(text) == ()
    assert shapes.lines(text) == ()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("10,10 20,20 30,10", "'10,10': a name must stand before the first point"),
        ("Belt 1,1 2,2 3,1", "'Belt' is not a name"),
        ("world 1,1 2,2 3,1", "'world' is not a name"),
        ("a 1,1 2,2", "'a': 2 points; a polygon has at least 3"),
        ("a", "'a': 0 points"),
        ("a 1,1", "'a': 1 point;"),
        ("a 1,1 2,2 3 4,4", "'a': '3' is not a point; a point is X,Y"),
        ("a 1,1 2,2 3,4,5", "'a': '3,4,5' is not a point"),
        ("a 1,1 2,2 x,4", "'a': 'x,4' is not a point; 'x' is not a number"),
        ("a 1,1 2,2 1_0,4", "'a': '1_0,4' is not a point; '1_0' is not a number"),
        ("a 1,1 2,2 nan,4", "'a': 'nan,4' is not finite"),
        ("a 1,1 2,2 4,-Infinity", "'a': '4,-Infinity' is not finite"),
        ("a 1,1 2,2 1e400,4", "'a': '1e400,4' is beyond 10000000"),
        ("a 0,0 1,0 1,1; b 0,0 1,0 1,1; a 0,0 1,0 1,1", "'a': the name is used twice"),
        ("a 0,0 1,0 1,0 1,1", "'a': points 2 and 3 are the same"),
        ("a 0,0 1,0 1,1 0,0", "'a': points 4 and 1 are the same"),
        ("a " + " ".join(f"{i},{i * i}" for i in range(51)), "'a': 51 points, above 50"),
        (";".join(f"a{i} 0,0 1,0 1,1" for i in range(51)), "more than 50 shapes"),
        ("x" * 8001, "8001 characters, above 8000"),
    ],
    ids=lambda text: text[:20],
)
def test_a_polygon_is_refused_with_its_name_and_the_reason(text: str, reason: str):
    with pytest.raises(ShapeError) as refused:
        shapes.polygons(text)
    assert reason in str(refused.value)


@pytest.mark.parametrize(
    ("points", "first", "second"),
    [
        # An hourglass: the diagonals 1-2 and 3-4 cross at (5, 5).
        ("0,0 10,10 10,0 0,10", "1 to 2", "3 to 4"),
        # The corner 4 lies on the edge 1-2.
        ("0,0 10,0 10,10 5,0 0,10", "1 to 2", "3 to 4"),
        # A thorn: from 2 to 3 and the same way back.
        ("0,0 10,0 20,0 10,0 5,9", "1 to 2", "3 to 4"),
        ("0,0 10,0 5,0 5,9", "1 to 2", "2 to 3"),
        ("5,0 10,0 10,9 20,0", "1 to 2", "4 to 1"),
        ("0,0 5,5 9,9", "1 to 2", "3 to 1"),
    ],
)
def test_a_polygon_that_crosses_itself_is_refused_with_the_edges(
    points: str, first: str, second: str
):
    with pytest.raises(ShapeError, match="crosses or touches") as refused:
        shapes.polygons(f"zone {points}")
    words = f"the edge from point {first} crosses or touches the edge from point {second}"
    assert str(refused.value) == f"'zone': {words}"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a 1,1", "'a': 1 point; a line has 2"),
        ("a 1,1 2,2 3,3", "'a': 3 points; a line has 2"),
        ("a 1,1 1,1", "'a': its two points are the same"),
    ],
)
def test_a_line_is_refused_with_its_name_and_the_reason(text: str, reason: str):
    with pytest.raises(ShapeError) as refused:
        shapes.lines(text)
    assert str(refused.value) == reason


def test_world_units_are_refused_where_only_pixels_are_allowed():
    with pytest.raises(ShapeError, match="'a': must be in pixels"):
        shapes.polygons("a world 0,0 1,0 1,1", world=False)


numbers = st.floats(-1e6, 1e6).map(lambda number: float(f"{number:.9g}"))
corners = st.lists(st.tuples(numbers, numbers), min_size=3, max_size=7, unique=True)


@settings(deadline=None)
@given(corners, st.sampled_from(["pixels", "world"]))
def test_the_text_of_shapes_is_parsed_as_the_same_shapes(points, unit):
    polygon, line = Polygon("a", tuple(points), unit), Line("b", points[0], points[1], unit)
    words = [f"{x:.12g},{y:.12g}" for x, y in points]
    assert shapes.lines(f"b {unit} {words[0]} {words[1]}") == (line,)
    try:
        assert shapes.polygons(f"a {unit} {' '.join(words)}") == (polygon,)
    except ShapeError as refused:
        assert "crosses" in str(refused)  # noqa: PT017 - most polygons of random corners do


@settings(deadline=None)
@given(st.text(max_size=60))
def test_any_text_is_parsed_or_refused(text: str):
    for read in (shapes.polygons, shapes.lines):
        try:
            read(text)
        except ShapeError as refused:
            assert str(refused)  # noqa: PT017


@settings(deadline=None)
@given(st.integers(3, 12), st.floats(0, 6.3), st.floats(0.1, 0.9))
def test_a_regular_polygon_is_accepted_and_contains_its_middle(sides, start, inner):
    """Independent of the even-odd rule: within the inscribed circle is inside, beyond the
    circumscribed one is outside."""
    angles = [start + 2 * math.pi * side / sides for side in range(sides)]
    corners = tuple((100 * math.cos(angle), 100 * math.sin(angle)) for angle in angles)
    (polygon,) = shapes.polygons("a " + " ".join(f"{x:.12g},{y:.12g}" for x, y in corners))
    inscribed = 100 * math.cos(math.pi / sides)
    for angle in (start / 2, start + 1, start + 4):
        x, y = math.cos(angle), math.sin(angle)
        assert shapes.contains(polygon.points, (inner * inscribed * x, inner * inscribed * y))
        assert not shapes.contains(polygon.points, (101 * x, 101 * y))
