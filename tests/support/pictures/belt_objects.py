"""Lays out the objects of a conveyor belt: shapes, colours and places, all by a seed.

A third of them lie in touching pairs, which is what counting objects on a belt is about.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
"""(n, 2) float64: X, Y in mm."""

CIRCLE_CORNERS = 48
COLOURS = (
    (40, 60, 200),
    (200, 140, 40),
    (60, 170, 70),
    (40, 190, 220),
    (190, 190, 190),
    (170, 60, 150),
    (210, 200, 120),
    (30, 110, 190),
)


@dataclass(frozen=True)
class BeltObject:
    """A flat object on the belt.

    Attributes:
        id: From 1, in the order in which the centres enter at X = 0.
        along_mm: X of its centre at time 0; negative, since it enters later.
        y_mm: Y of its centre, the same at all times.
        outline_mm: (n, 2), convex, relative to the centre.
        colour: BGR.
        touches: Id of the object that it touches at all times, or None.
    """

    id: int
    along_mm: float
    y_mm: float
    outline_mm: Points
    colour: tuple[int, int, int]
    touches: int | None = None


def disc(radius_mm: float) -> Points:
    """Return the outline of a disc, relative to its centre."""
    angles = np.arange(CIRCLE_CORNERS) * 2 * np.pi / CIRCLE_CORNERS
    return radius_mm * np.stack([np.cos(angles), np.sin(angles)], 1)


def box(length_mm: float, width_mm: float, degrees: float = 0.0) -> Points:
    """Return the outline of a rectangle, relative to its centre, turned."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [length_mm / 2, width_mm / 2]
    turn = np.radians(degrees)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return np.asarray(corners @ rotation.T)


PAIRS: tuple[tuple[Points, Points, float, float], ...] = (
    (disc(26), disc(26), 52.0, 0.0),  # one behind the other
    (disc(24), disc(30), 0.0, 54.0),  # side by side
    (box(60, 44), disc(24), 54.0, 6.0),
    (box(56, 40), box(48, 40), 8.0, 40.0),  # flush sides
    (box(48, 48, 45), disc(25), 58.9, 0.0),  # a corner touches
)
"""Outlines of both, and the second centre relative to the first, mm: along, across."""


def lay_out(number: int, width_mm: float, first_mm: float, seed: int) -> list[BeltObject]:
    """Return objects on an empty belt: in touching pairs, two abreast, and alone.

    Args:
        number: Of objects; a third of them, rounded down, in touching pairs.
        width_mm: Of the belt; all objects lie wholly on it.
        first_mm: X at time 0 of the front of the first, negative.
        seed: Determines shapes, places and colours.
    """
    rng = np.random.default_rng((seed, 0))
    groups: list[list[_Placed]] = []
    for index in range(number // 6):
        one, other, along, across = PAIRS[index % len(PAIRS)]
        y = float(rng.uniform(70, width_mm - 70 - across))
        groups.append([(0.0, y, one), (-along, y + across, other)])
    left = number - 2 * len(groups)
    while left:
        members: list[_Placed] = []
        if left >= 2 and rng.random() < 0.3:
            members.append((0.0, float(rng.uniform(60, 110)), some_shape(rng)))
            members.append((float(rng.uniform(-20, 20)), width_mm - 75.0, some_shape(rng)))
        else:
            members.append((0.0, float(rng.uniform(60, width_mm - 60)), some_shape(rng)))
        left -= len(members)
        groups.append(members)

    front = first_mm
    rows: list[tuple[float, float, Points, int]] = []  # with the number of the group
    for group in rng.permutation(len(groups)).tolist():
        members = groups[group]
        shift = front - max(x + float(outline[:, 0].max()) for x, _, outline in members)
        rows += [(x + shift, y, outline, group) for x, y, outline in members]
        behind = min(x + float(outline[:, 0].min()) for x, _, outline in members)
        front = behind + shift - float(rng.uniform(45, 110))
    rows.sort(key=lambda row: -row[0])

    objects = []
    for index, (x, y, outline, group) in enumerate(rows):
        partners = [i + 1 for i, row in enumerate(rows) if row[3] == group and i != index]
        touches = partners[0] if group < number // 6 else None
        # Neighbours in the order of entry never have the same colour.
        colour = COLOURS[(index * 3 + seed) % len(COLOURS)]
        objects.append(BeltObject(index + 1, x, y, outline, colour, touches))
    return objects


_Placed = tuple[float, float, Points]
"""Centre along and across the belt, mm, and outline."""


def some_shape(rng: np.random.Generator) -> Points:
    """Return the outline of a disc or of a turned rectangle, 36 to 80 mm long."""
    if rng.random() < 0.4:
        return disc(float(rng.uniform(18, 32)))
    return box(float(rng.uniform(44, 80)), float(rng.uniform(36, 52)), float(rng.uniform(0, 180)))
