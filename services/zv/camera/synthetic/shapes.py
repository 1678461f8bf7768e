"""Draws each kind of object in each phase of its step or turn."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from zv.camera.synthetic.sprite import Color, Point, Sketch, Sprite

Kind = Literal["walker", "cart", "ball", "kite"]

SKIN: Color = (128, 164, 214)
DARK: Color = (40, 34, 32)
WHITE: Color = (240, 240, 240)

WIDTHS: dict[Kind, float] = {"walker": 0.54, "cart": 1.45, "ball": 1.0, "kite": 1.5}  # of height
PHASES: dict[Kind, int] = {"walker": 16, "cart": 6, "ball": 24, "kite": 1}


@dataclass(frozen=True, slots=True)
class Colors:
    """The colours of a figure, BGR."""

    main: Color
    second: Color
    accent: Color


def draw(
    kind: Kind, height: float, colors: Colors, grain: NDArray[np.float32]
) -> dict[int, tuple[Sprite, ...]]:
    """Draw all poses of a figure of some height in pixels, with a texture as in ``Sketch.sprite``.

    Returns:
        The phases of one cycle, facing right under 1 and facing left under -1, all of one size.
    """
    shape = {"walker": _walker, "cart": _cart, "ball": _ball, "kite": _kite}[kind]
    sketches = [Sketch(WIDTHS[kind], height) for _ in range(PHASES[kind])]
    for phase, sketch in enumerate(sketches):
        shape(sketch, phase / PHASES[kind], colors)
    return {
        facing: tuple(sketch.sprite(grain, facing) for sketch in sketches) for facing in (1, -1)
    }


def _darker(color: Color, share: float = 0.72) -> Color:
    return round(color[0] * share), round(color[1] * share), round(color[2] * share)


def _offset(origin: Point, angle: float, length: float) -> Point:
    """Return the point at a distance and angle from another; angle 0 is straight down."""
    return origin[0] + length * math.sin(angle), origin[1] + length * math.cos(angle)


def _walker(sketch: Sketch, turn: float, colors: Colors) -> None:
    middle = WIDTHS["walker"] / 2
    hip, shoulder = (middle, 0.52), (middle, 0.225)
    swing = 0.46 * math.sin(2 * math.pi * turn)
    forward = math.cos(2 * math.pi * turn)

    def leg(angle: float, bend: float, cloth: Color) -> None:
        knee = _offset(hip, angle, 0.235)
        ankle = _offset(knee, angle - bend, 0.21)
        sketch.limb(hip, knee, 0.105, cloth)
        sketch.limb(knee, ankle, 0.085, cloth)
        sketch.limb(ankle, (ankle[0] + 0.045, ankle[1] + 0.005), 0.06, DARK)

    def arm(angle: float, cloth: Color) -> None:
        elbow = _offset(shoulder, angle, 0.15)
        hand = _offset(elbow, angle + 0.35, 0.13)
        sketch.limb(shoulder, elbow, 0.072, cloth)
        sketch.limb(elbow, hand, 0.06, cloth)
        sketch.disc(hand, 0.034, SKIN)

    arm(swing, _darker(colors.main))
    leg(-swing, 0.08 + 0.45 * max(0.0, -forward), _darker(colors.second))
    leg(swing, 0.08 + 0.45 * max(0.0, forward), colors.second)
    sketch.limb((middle, 0.245), (middle, 0.48), 0.205, colors.main)
    left, right = middle - 0.10, middle + 0.10
    sketch.polygon([(left, 0.33), (right, 0.33), (right, 0.38), (left, 0.38)], colors.accent)
    sketch.limb((middle, 0.13), (middle, 0.19), 0.07, _darker(SKIN, 0.85))
    sketch.disc((middle + 0.008, 0.082), 0.075, SKIN)
    sketch.arc((middle - 0.004, 0.077), (0.082, 0.077), (165.0, 345.0), DARK)
    arm(-swing, _darker(colors.main, 0.86))


def _cart(sketch: Sketch, turn: float, colors: Colors) -> None:
    right = WIDTHS["cart"] - 0.02
    wall = [(0.06, 0.16), (right - 0.12, 0.16), (right, 0.40), (right, 0.80), (0.02, 0.80)]
    sketch.polygon(wall, colors.main)
    sketch.polygon([(0.10, 0.0), (right - 0.24, 0.0), (right - 0.10, 0.19), (0.04, 0.19)], WHITE)
    sketch.polygon([(0.02, 0.60), (right, 0.60), (right, 0.70), (0.02, 0.70)], colors.accent)
    sketch.polygon(
        [(right - 0.34, 0.27), (right - 0.12, 0.27), (right - 0.04, 0.47), (right - 0.34, 0.47)],
        colors.second,
    )
    for x in (0.26, WIDTHS["cart"] / 2, WIDTHS["cart"] - 0.26):
        sketch.disc((x, 0.83), 0.165, DARK)
        sketch.disc((x, 0.83), 0.085, (170, 170, 170))
        for spoke in range(3):
            # Two thirds of the spokes' symmetry per cycle, so that they seem to turn forward.
            angle = -2 * math.pi * (spoke / 3 + turn / 3)
            sketch.limb((x, 0.83), _offset((x, 0.83), angle, 0.085), 0.025, DARK)


def _ball(sketch: Sketch, turn: float, colors: Colors) -> None:
    panels = (colors.main, WHITE, colors.second, WHITE, colors.accent, WHITE)
    for index, color in enumerate(panels):
        begin = 360.0 * turn + 60.0 * index
        sketch.arc((0.5, 0.5), (0.49, 0.49), (begin, begin + 63.0), color)
    sketch.disc((0.5, 0.5), 0.09, WHITE)


def _kite(sketch: Sketch, _turn: float, colors: Colors) -> None:
    right = WIDTHS["kite"]
    nose, fold, low, high = (right - 0.01, 0.52), (0.16, 0.52), (0.0, 0.99), (0.0, 0.01)
    sketch.polygon([high, nose, low, fold], colors.main)
    sketch.polygon([fold, nose, low], colors.second)
    sketch.polygon([(0.0, 0.62), (right * 0.62, 0.52), fold, (0.0, 0.42)], colors.accent)
