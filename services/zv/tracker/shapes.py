"""Parses named polygons and lines from text; errors name the shape and the reason.

A shape is a name and its points, `x,y` with spaces between them; shapes are separated by `;` or
by a new line. Text after `#` is a comment. Coordinates are full-resolution pixels, or units of the
calibration's world plane if `world` stands between name and points:

```
belt 10,10 200,10 200,100 10,100; door 300,40 340,40 340,200 300,200
pick world 0,0 0.4,0 0.4,0.2 0,0.2   # metres, if the plane was calibrated in metres
```
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Literal, TypeVar

MAX_CHARACTERS = 8000
MAX_SHAPES = 50
MAX_POINTS = 50
MAX_COORDINATE = 1e7
"""Beyond any picture, and beyond the metres of map projections."""

NAME = re.compile(r"[a-z0-9_]{1,32}")
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)(e[+-]?[0-9]+)?", re.IGNORECASE)

POLYGONS_FORM = "polygons such as belt 10,10 200,10 200,100; pick world 0,0 0.4,0 0.4,0.2"
LINES_FORM = "lines such as gate 50,0 50,100; pick world 0,0 0,0.4"

Unit = Literal["pixels", "world"]
Point = tuple[float, float]
Points = tuple[Point, ...]


class ShapeError(ValueError):
    """A shape is invalid; the text names the shape and the reason."""


@dataclass(frozen=True, slots=True)
class Polygon:
    """A simple polygon: 3 to ``MAX_POINTS`` corners, edges that meet only at the corners."""

    name: str  # unique in its text
    points: Points  # its corners, clockwise or not; the first is not repeated at the end
    # ``pixels`` of the full-resolution frame, or units of the ``world`` plane.
    unit: Unit = "pixels"

    @property
    def edges(self) -> tuple[tuple[Point, Point], ...]:
        """Its edges, each from a corner to the next; the last ends at the first corner."""
        return tuple(pairwise((*self.points, self.points[0])))


@dataclass(frozen=True, slots=True)
class Line:
    """A straight line between two different points. Its direction matters: see ``side_of``."""

    name: str  # unique in its text
    start: Point  # its first point
    end: Point  # its second point
    unit: Unit = "pixels"  # as for a polygon


Shape = TypeVar("Shape", Polygon, Line)


def polygons(text: str, *, world: bool = True) -> tuple[Polygon, ...]:
    """Parse the polygons of a text, in its order; none for an empty text.

    Args:
        text: As in the module's docstring.
        world: Whether polygons in world units are allowed.

    Raises:
        ShapeError: Names the polygon and the reason: a bad or repeated name, fewer than 3 points,
            a coordinate that is not a finite number, the same point twice in a row, edges that
            cross or touch, too many polygons or points.
    """
    return _shapes(text, _polygon, world=world)


def lines(text: str) -> tuple[Line, ...]:
    """Parse the lines of a text, in its order; see ``polygons``.

    Raises:
        ShapeError: As for polygons; a line has two different points.
    """
    return _shapes(text, _line)


def contains(points: Sequence[Point], point: Point) -> bool:
    """Return whether a point is inside a polygon. A point on an edge may count as either.

    Source: the even-odd rule (Shimrat, Algorithm 112, CACM 1962).
    """
    x, y = point
    inside = False
    for (ax, ay), (bx, by) in pairwise((*points, points[0])):
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            inside = not inside
    return inside


def turn(a: Point, b: Point, c: Point) -> float:
    """Return twice the signed area of a triangle: positive if c is right of the line from a to b.

    Right is meant as in a picture, where y points down; a, b, c are then clockwise.
    """
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def touch(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Return whether the edge from a to b and the one from c to d have a point in common."""
    first, second = _sign(turn(a, b, c)), _sign(turn(a, b, d))
    third, fourth = _sign(turn(c, d, a)), _sign(turn(c, d, b))
    if first != second and third != fourth:
        return True
    return (
        (first == 0 and _between(a, c, b))
        or (second == 0 and _between(a, d, b))
        or (third == 0 and _between(c, a, d))
        or (fourth == 0 and _between(c, b, d))
    )


def distance(point: Point, a: Point, b: Point) -> float:
    """Return the distance of a point from the edge from a to b."""
    along = (b[0] - a[0], b[1] - a[1])
    length = along[0] ** 2 + along[1] ** 2
    share = ((point[0] - a[0]) * along[0] + (point[1] - a[1]) * along[1]) / length if length else 0
    share = min(1.0, max(0.0, share))
    return math.dist(point, (a[0] + share * along[0], a[1] + share * along[1]))


def passage(start: Point, end: Point, a: Point, b: Point) -> float | None:
    """Return where the step from start to end crosses the edge from a to b.

    Returns:
        The fraction of the step, 0 to 1; None if it does not cross the edge. A point on the
        edge's line belongs to its right side, so that a path with a point there crosses once.
    """
    from_side, to_side = turn(a, b, start), turn(a, b, end)
    if (from_side >= 0) == (to_side >= 0):
        return None
    if (turn(start, end, a) >= 0) == (turn(start, end, b) >= 0):
        return None
    return from_side / (from_side - to_side)


def _shapes(
    text: str, make: Callable[[str, Points, Unit], Shape], *, world: bool = True
) -> tuple[Shape, ...]:
    if len(text) > MAX_CHARACTERS:
        raise ShapeError(f"{len(text)} characters, above {MAX_CHARACTERS}")
    found: dict[str, Shape] = {}
    for words in _statements(text):
        name, unit, rest = _head(words)
        if name in found:
            raise ShapeError(f"{name!r}: the name is used twice")
        if unit == "world" and not world:
            raise ShapeError(f"{name!r}: must be in pixels, not in world units")
        if len(rest) > MAX_POINTS:
            raise ShapeError(f"{name!r}: {len(rest)} points, above {MAX_POINTS}")
        found[name] = make(name, tuple(_point(name, word) for word in rest), unit)
        if len(found) > MAX_SHAPES:
            raise ShapeError(f"more than {MAX_SHAPES} shapes")
    return tuple(found.values())


def _statements(text: str) -> Iterator[list[str]]:
    """Yield the words of each shape."""
    for row in text.splitlines():
        for statement in row.partition("#")[0].split(";"):
            if words := re.sub(r"\s*,\s*", ",", statement).split():
                yield words


def _head(words: list[str]) -> tuple[str, Unit, list[str]]:
    """Split the words of a shape into name, unit and points."""
    name, *rest = words
    if "," in name:
        raise ShapeError(f"{_shown(name)}: a name must stand before the first point")
    if not NAME.fullmatch(name) or name == "world":
        raise ShapeError(
            f"{_shown(name)} is not a name; a name has 1 to 32 of a-z, 0-9 and _, except 'world'"
        )
    if rest and rest[0] in ("world", "pixels"):
        return name, "world" if rest[0] == "world" else "pixels", rest[1:]
    return name, "pixels", rest


def _point(name: str, word: str) -> Point:
    numbers = word.split(",")
    if len(numbers) != 2:
        raise ShapeError(f"{name!r}: {_shown(word)} is not a point; a point is X,Y")
    x, y = (_number(name, word, number) for number in numbers)
    return x, y


def _number(name: str, word: str, text: str) -> float:
    if text.lower().lstrip("+-") in ("nan", "inf", "infinity"):
        raise ShapeError(f"{name!r}: {_shown(word)} is not finite")
    if not NUMBER.fullmatch(text):
        raise ShapeError(f"{name!r}: {_shown(word)} is not a point; {_shown(text)} is not a number")
    number = float(text)
    if not math.isfinite(number) or abs(number) > MAX_COORDINATE:
        raise ShapeError(f"{name!r}: {_shown(word)} is beyond {MAX_COORDINATE:.0f}")
    return number


def _polygon(name: str, points: Points, unit: Unit) -> Polygon:
    if len(points) < 3:
        raise ShapeError(f"{name!r}: {_count(points)}; a polygon has at least 3")
    for number, (point, following) in enumerate(pairwise((*points, points[0])), 1):
        if point == following:
            after = number % len(points) + 1
            raise ShapeError(f"{name!r}: points {number} and {after} are the same")
    polygon = Polygon(name, points, unit)
    _refuse_crossing(polygon)
    return polygon


def _refuse_crossing(polygon: Polygon) -> None:
    edges = polygon.edges
    for (first, (a, b)), (second, (c, d)) in combinations(enumerate(edges), 2):
        # Neighbours share a corner. They touch elsewhere only if the second turns back.
        if second == first + 1:
            crossing = _turns_back(a, b, d)
        elif first == 0 and second == len(edges) - 1:
            crossing = _turns_back(c, a, b)
        else:
            crossing = touch(a, b, c, d)
        if crossing:
            raise ShapeError(
                f"{polygon.name!r}: the edge from point {_ends(first, edges)} crosses or "
                f"touches the edge from point {_ends(second, edges)}"
            )


def _turns_back(a: Point, b: Point, c: Point) -> bool:
    """Return whether the edge from b to c runs back along the edge from a to b."""
    return turn(a, b, c) == 0 and (a[0] - b[0]) * (c[0] - b[0]) + (a[1] - b[1]) * (c[1] - b[1]) > 0


def _line(name: str, points: Points, unit: Unit) -> Line:
    if len(points) != 2:
        raise ShapeError(f"{name!r}: {_count(points)}; a line has 2")
    if points[0] == points[1]:
        raise ShapeError(f"{name!r}: its two points are the same")
    return Line(name, *points, unit)


def _ends(edge: int, edges: Sequence[object]) -> str:
    return f"{edge + 1} to {(edge + 1) % len(edges) + 1}"


def _count(points: Points) -> str:
    return f"{len(points)} point{'' if len(points) == 1 else 's'}"


def _shown(text: str) -> str:
    return repr(text if len(text) <= 40 else f"{text[:40]}...")


def _between(a: Point, point: Point, b: Point) -> bool:
    """Return whether a point on the line through a and b lies between them."""
    return min(a[0], b[0]) <= point[0] <= max(a[0], b[0]) and (
        min(a[1], b[1]) <= point[1] <= max(a[1], b[1])
    )


def _sign(number: float) -> int:
    return (number > 0) - (number < 0)
