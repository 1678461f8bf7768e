"""What is known of one object that is followed through the frames of a camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Box = tuple[int, int, int, int]
"""x, y, width, height in full-resolution pixels."""


@dataclass(frozen=True, slots=True)
class Track:
    """One object at the stamp of one frame.

    Attributes:
        id: Never reused within an epoch.
        state: ``confirmed`` are those that one would draw now; ``tentative`` are too new to be
            sure of; ``lost`` were confirmed and are not seen at the moment.
        x: Centre of the object, smoothed over time, at most a tenth of its side from the box's;
            full-resolution pixels, as are all lengths here.
        y: As x.
        box: x, y, width, height.
        area: Of its foreground, square pixels.
        vx: Velocity, pixels per second of the capture stamps.
        vy: As vx.
        age_s: Since it was seen first.
        missing_s: Since it was seen last; 0 if it is seen in this frame.
        steady: A point of the object as measured in this frame alone; None if it was not. It moves
            as the object does, while the middle lags behind, and is that of the part in view.
        offset: From there to the middle, x and y.
    """

    id: int
    state: Literal["tentative", "confirmed", "lost"]
    x: float
    y: float
    box: Box
    area: float
    vx: float = 0.0
    vy: float = 0.0
    age_s: float = 0.0
    missing_s: float = 0.0
    steady: tuple[float, float] | None = None
    offset: tuple[float, float] = (0.0, 0.0)
