"""Draws each kind of object in each phase of its step or turn."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from zv.camera.synthetic.sprite import Color, Point, Sketch, Sprite

Kind = Literal["walker", "cart", "ball", "kite"]
Colors = tuple[Color, Color, Color]
"""Main, second and accent colour of a figure, BGR."""

SKIN: Color = (128, 164, 214)
DARK: Color = (40, 34, 32)
GREY: Color = (170, 170, 170)
WHITE: Color = (240, 240, 240)

WIDTHS: dict[Kind, float] = {"walker": 0.54, "cart": 1.45, "ball": 1.0, "kite": 1.5}  # of height
PHASES: dict[Kind, int] = {"walker": 16, "cart": 6, "ball": 24, "kite": 1}


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


def _chain(sketch: Sketch, at: Point, *parts: tuple[float, float, float, Color]) -> None:
    """Draw limbs one behind the other: angle from straight down, length, thickness, colour."""
    for angle, length, thickness, color in parts:
        end = at[0] + length * sin(angle), at[1] + length * cos(angle)
        sketch.limb(at, end, thickness, color)
        at = end


def _walker(sketch: Sketch, turn: float, colors: Colors) -> None:
    main, second, accent = colors
    middle, swing, forward = 0.27, 0.46 * sin(2 * pi * turn), cos(2 * pi * turn)

    def leg(angle: float, forward: float, cloth: Color) -> None:
        shin, foot = angle - 0.08 - 0.45 * max(0.0, forward), (pi / 2, 0.045, 0.06, DARK)
        hip = (middle, 0.52)
        _chain(sketch, hip, (angle, 0.235, 0.105, cloth), (shin, 0.21, 0.085, cloth), foot)

    def arm(angle: float, cloth: Color) -> None:
        lower, hand = (angle + 0.35, 0.13, 0.06, cloth), (0.0, 0.0, 0.068, SKIN)
        _chain(sketch, (middle, 0.225), (angle, 0.15, 0.072, cloth), lower, hand)

    arm(swing, _darker(main))
    leg(-swing, -forward, _darker(second))
    leg(swing, forward, second)
    sketch.limb((middle, 0.245), (middle, 0.48), 0.205, main)
    sketch.limb((middle - 0.08, 0.355), (middle + 0.08, 0.355), 0.05, accent)
    sketch.limb((middle, 0.13), (middle, 0.19), 0.07, _darker(SKIN, 0.85))
    sketch.limb((middle, 0.08), (middle, 0.08), 0.16, DARK)
    sketch.sector((middle + 0.008, 0.082), 0.075, (-15, 165), SKIN)
    arm(-swing, _darker(main, 0.86))


def _cart(sketch: Sketch, turn: float, colors: Colors) -> None:
    main, second, accent = colors
    width, right = WIDTHS["cart"], WIDTHS["cart"] - 0.02
    wall = [(0.06, 0.16), (right - 0.12, 0.16), (right, 0.40), (right, 0.80), (0.02, 0.80)]
    roof = [(0.10, 0.0), (right - 0.24, 0.0), (right - 0.10, 0.19), (0.04, 0.19)]
    window = [(1.09, 0.27), (1.31, 0.27), (1.39, 0.47), (1.09, 0.47)]
    stripe = [(0.02, 0.60), (right, 0.60), (right, 0.70), (0.02, 0.70)]
    for corners, color in ((wall, main), (roof, WHITE), (stripe, accent), (window, second)):
        sketch.polygon(corners, color)
    for x in (0.26, width / 2, width - 0.26):
        sketch.limb((x, 0.83), (x, 0.83), 0.33, DARK)
        sketch.limb((x, 0.83), (x, 0.83), 0.17, GREY)
        for spoke in range(3):
            # Two thirds of the spokes' symmetry per cycle, so that they seem to turn forward.
            _chain(sketch, (x, 0.83), (-2 * pi * (spoke + turn) / 3, 0.085, 0.025, DARK))


def _ball(sketch: Sketch, turn: float, colors: Colors) -> None:
    for index, color in enumerate((colors[0], WHITE, colors[1], WHITE, colors[2], WHITE)):
        begin = 360.0 * turn + 60.0 * index
        sketch.sector((0.5, 0.5), 0.49, (begin, begin + 63.0), color)
    sketch.limb((0.5, 0.5), (0.5, 0.5), 0.18, WHITE)


def _kite(sketch: Sketch, _turn: float, colors: Colors) -> None:
    right = WIDTHS["kite"]
    nose, fold, low, high = (right - 0.01, 0.52), (0.16, 0.52), (0.0, 0.99), (0.0, 0.01)
    sketch.polygon([high, nose, low, fold], colors[0])
    sketch.polygon([fold, nose, low], colors[1])
    sketch.polygon([(0.0, 0.62), (right * 0.62, 0.52), fold, (0.0, 0.42)], colors[2])
