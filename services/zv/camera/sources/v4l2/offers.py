"""What a device offers: formats, their sizes, and the rates of each size."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from videodev2 import videodev2 as v4l2

from zv.camera.sources.v4l2.driver import (
    DISCRETE,
    ENUM_FRAMEINTERVALS,
    ENUM_FRAMESIZES,
    Driver,
    FrameInterval,
    FrameSize,
    code_of,
    fourcc_of,
    rate_of,
    text_of,
)

CLOSE: Final = 0.99
"""Share of a rate that counts as the rate: 30000/1001 is taken for 30."""


@dataclass(frozen=True, slots=True)
class Rates:
    """The rates of one format and size.

    Attributes:
        values: Hz, descending; two of them, the fastest and the slowest, if ``between``. Empty if
            the driver does not say.
        between: Whether any rate between the two is offered.
    """

    values: tuple[float, ...] = ()
    between: bool = False

    @property
    def fastest(self) -> float | None:
        """The highest rate, Hz; None if the driver does not say."""
        return max(self.values, default=None)

    def reaches(self, rate_hz: float) -> bool:
        """Tell whether the rate can be had; True if the driver does not say."""
        return self.fastest is None or self.fastest >= CLOSE * rate_hz

    def for_wish(self, rate_hz: float) -> float | None:
        """Return the lowest rate that is enough, else the highest; None if none is stated."""
        enough = [each for each in self.values if each >= CLOSE * rate_hz]
        if self.between and enough:
            return max(rate_hz, min(self.values))
        return min(enough, default=self.fastest)

    def __str__(self) -> str:
        """Return the rates as they are listed: ``30, 15 Hz``."""
        if not self.values:
            return "rate not stated"
        if self.between:
            return f"{self.values[-1]:.4g} to {self.values[0]:.4g} Hz"
        return f"{', '.join(f'{each:.4g}' for each in self.values)} Hz"


@dataclass(frozen=True, slots=True)
class Sizes:
    """A size, or a range of sizes, of one format.

    Attributes:
        width: The smallest and the largest, and the step between, pixels.
        height: The same.
    """

    width: tuple[int, int, int]
    height: tuple[int, int, int]

    @property
    def is_range(self) -> bool:
        """Whether it is more than one size."""
        return self.width[0] != self.width[1] or self.height[0] != self.height[1]

    def nearest(self, width: int, height: int) -> tuple[int, int]:
        """Return the size of the range that is nearest to a wanted one."""
        return _nearest(self.width, width), _nearest(self.height, height)

    def __str__(self) -> str:
        """Return it as it is listed: ``640x480``, or ``16x16 to 1920x1080``."""
        smallest, largest = f"{self.width[0]}x{self.height[0]}", f"{self.width[1]}x{self.height[1]}"
        return f"{smallest} to {largest}" if self.is_range else smallest


@dataclass(frozen=True, slots=True)
class Offer:
    """One format of a device.

    Attributes:
        fourcc: Four characters.
        description: By the driver, such as ``Motion-JPEG``.
        sizes: Those that the driver lists; empty if it lists none.
    """

    fourcc: str
    description: str
    sizes: tuple[Sizes, ...]


def offers_of(driver: Driver) -> list[Offer]:
    """Return the formats of a device, in the driver's order, each once."""
    wanted = v4l2.v4l2_fmtdesc()
    wanted.type = driver.type
    found: dict[str, Offer] = {}
    for item in driver.listed(v4l2.VIDIOC_ENUM_FMT, wanted):
        each: Any = item
        code, words = int(each.pixelformat), text_of(each.description)
        fourcc = fourcc_of(code)
        found.setdefault(fourcc, Offer(fourcc, words, tuple(_sizes(driver, code))))
    return list(found.values())


def rates_of(driver: Driver, fourcc: str, width: int, height: int) -> Rates:
    """Return the rates of a format in one size."""
    wanted = FrameInterval()
    wanted.pixel_format, wanted.width, wanted.height = code_of(fourcc), width, height
    rates = []
    for each in driver.listed(ENUM_FRAMEINTERVALS, wanted):
        if each.type != DISCRETE:
            ends = map(rate_of, (each.stepwise.min, each.stepwise.max))
            return Rates(tuple(sorted(filter(None, ends), reverse=True)), between=True)
        rates.append(rate_of(each.discrete))
    return Rates(tuple(sorted({rate for rate in rates if rate}, reverse=True)))


def _sizes(driver: Driver, code: int) -> Iterator[Sizes]:
    wanted = FrameSize()
    wanted.pixel_format = code
    for each in driver.listed(ENUM_FRAMESIZES, wanted):
        if each.type != DISCRETE:
            part = each.stepwise
            yield Sizes(
                (part.min_width, part.max_width, max(1, part.step_width)),
                (part.min_height, part.max_height, max(1, part.step_height)),
            )
            return
        width, height = each.discrete.width, each.discrete.height
        yield Sizes((width, width, 1), (height, height, 1))


def _nearest(sides: tuple[int, int, int], wanted: int) -> int:
    low, high, step = sides
    within = min(max(wanted, low), high)
    return low + round((within - low) / step) * step if step > 1 else within
