"""A track: the position, the velocity and the state of one object in one frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

State = Literal["tentative", "confirmed", "lost"]

Box = tuple[int, int, int, int]
"""x, y, width, height in full-resolution pixels."""


@dataclass(frozen=True, slots=True)
class Track:
    """One object at the stamp of one frame."""

    id: int  # its number, never reused within an epoch
    # ``tentative`` if it is too new to be certain, ``confirmed``, or ``lost`` if it was confirmed
    # and is not seen at the moment.
    state: State
    # Centre of the object, smoothed over time, at most a tenth of its side from the box's centre;
    # full-resolution pixels, as are all lengths here.
    x: float
    y: float  # as x
    box: Box  # x, y, width, height
    area: float  # area of its foreground, square pixels
    vx: float = 0.0  # velocity, pixels per second of the capture stamps
    vy: float = 0.0  # as vx
    age_s: float = 0.0  # seconds since it was first seen
    missing_s: float = 0.0  # seconds since it was last seen; 0 if it is seen in this frame
    # A point of the object as measured in this frame alone; None if it was not measured. It moves
    # with the object, while the centre is smoothed, and is that of the part in view while the
    # object enters the picture.
    steady: tuple[float, float] | None = None
    offset: tuple[float, float] = (0.0, 0.0)  # from ``steady`` to the centre, x and y
    class_name: str | None = None  # name of its class, if a model says it
    score: float | None = None  # how sure the model was when it last found it, 0 to 1

    def moved(self, x: int, y: int) -> Track:
        """Return it at another place."""
        if x == y == 0:
            return self
        left, top, width, height = self.box
        steady = self.steady and (self.steady[0] + x, self.steady[1] + y)
        box = left + x, top + y, width, height
        return replace(self, x=self.x + x, y=self.y + y, box=box, steady=steady)
