"""Chooses format, size and rate among those that a device offers.

The rule, each step among what the steps before have left:

1. What was asked for: the format, the width, the height, and a rate of at least the one asked for.
   What is not offered is refused, with what is.
2. Where neither width nor height was asked for, the size nearest to 640x480.
3. The rate that was asked for, or else 30 Hz, or the nearest below it.
4. The format that is cheapest to handle (``layouts.PREFERENCE``).
5. The larger picture.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from zenoh_vision.error_text import did_you_mean, similar_names
from zenoh_vision.errors import SourceError
from zv.camera.sources.base import DeviceWish
from zv.camera.sources.v4l2.layouts import preference
from zv.camera.sources.v4l2.offers import Offer, Rates, Sizes

USUAL_SIZE: Final = (640, 480)
USUAL_RATE_HZ: Final = 30.0
MOST_NAMED: Final = 12
"""Sizes that an error names."""


@dataclass(frozen=True, slots=True)
class Mode:
    """A format, a size and a rate that a device offers; None for a rate that is not stated."""

    fourcc: str
    width: int
    height: int
    rate_hz: float | None

    def __str__(self) -> str:
        """Return it in words: ``YUYV 640x480 at 30 Hz``."""
        rate = "" if self.rate_hz is None else f" at {self.rate_hz:.4g} Hz"
        return f"{self.fourcc.strip()} {self.width}x{self.height}{rate}"


RatesOf = Callable[[str, int, int], Rates]
"""Returns the rates of a format, a width and a height."""


def choose(offers: Sequence[Offer], wish: DeviceWish, rates_of: RatesOf) -> Mode:
    """Return the mode for a wish.

    Raises:
        SourceError: The device does not offer it; the text has the wish and what is offered.
    """
    left = _of_format(offers, wish)
    sized = [(offer, size) for offer in left for size in _sizes(offer, wish)]
    if not sized:
        raise _no_size(left, wish)
    if wish.rate_hz is not None:
        rate_hz = wish.rate_hz
        sized = [each for each in sized if rates_of(each[0].fourcc, *each[1]).reaches(rate_hz)]
        if not sized:
            raise _no_rate(left, wish, rates_of)
    if wish.width is None and wish.height is None:
        nearest = min(_distance(size) for _, size in sized)
        sized = [each for each in sized if _distance(each[1]) == nearest]
    rated = [(offer, size, rates_of(offer.fourcc, *size)) for offer, size in sized]
    target = wish.rate_hz or USUAL_RATE_HZ

    def rank(item: tuple[Offer, tuple[int, int], Rates]) -> tuple[float, int, int]:
        offer, (width, height), rates = item
        reached = rates.reaches(target) or rates.fastest
        rate = target if reached is True else float(reached or 0.0)
        return -rate, preference(offer.fourcc, deep=wish.deep), -width * height

    offer, (width, height), rates = min(rated, key=rank)
    return Mode(offer.fourcc, width, height, rates.for_wish(target))


def _of_format(offers: Sequence[Offer], wish: DeviceWish) -> list[Offer]:
    usable = [offer for offer in offers if preference(offer.fourcc) >= 0]
    names = [offer.fourcc.strip() for offer in usable]
    if wish.fourcc is not None:
        wanted = wish.fourcc.strip()
        found = [offer for offer in usable if offer.fourcc.strip() == wanted]
        if not found:
            near = did_you_mean(similar_names(wanted, names, limit=2), before=" ")
            known = any(offer.fourcc.strip() == wanted for offer in offers)
            why = "is offered, but cannot be read" if known else "is not offered"
            raise SourceError(f"fourcc {wanted} {why};{near} offered: {', '.join(names)}")
        return found
    if not usable:
        all_names = ", ".join(offer.fourcc.strip() for offer in offers) or "no format at all"
        raise SourceError(f"it offers no format that can be read, only {all_names}")
    return usable


def _sizes(offer: Offer, wish: DeviceWish) -> Iterator[tuple[int, int]]:
    """Yield the sizes of a format that fit a wish."""
    usual = USUAL_SIZE
    for each in offer.sizes or (Sizes((1, 1 << 15, 1), (1, 1 << 15, 1)),):
        wide = wish.width or (round(wish.height * 4 / 3) if wish.height else usual[0])
        high = wish.height or (round(wish.width * 3 / 4) if wish.width else usual[1])
        width, height = each.nearest(wide, high)
        if wish.width in (None, width) and wish.height in (None, height):
            yield width, height


def _distance(size: tuple[int, int]) -> int:
    return abs(size[0] * size[1] - USUAL_SIZE[0] * USUAL_SIZE[1])


def _no_size(offers: Sequence[Offer], wish: DeviceWish) -> SourceError:
    asked = f"{wish.width or 'any width'} x {wish.height or 'any height'}"
    if wish.width and wish.height:
        asked = f"{wish.width}x{wish.height}"
    sizes = _joined(str(each) for offer in offers for each in offer.sizes)
    of_format = f" with {wish.fourcc.strip()}" if wish.fourcc else ""
    return SourceError(f"size {asked} is not offered{of_format}; offered: {sizes}")


def _no_rate(offers: Sequence[Offer], wish: DeviceWish, rates_of: RatesOf) -> SourceError:
    """Return the refusal of a rate, with the rates that are offered, and sizes that have it."""
    fitting = _rates(((offer, size) for offer in offers for size in _sizes(offer, wish)), rates_of)
    words = _joined(f"{width}x{height}: {rates}" for (width, height), rates in fitting.items())
    discrete = (
        (offer, each.nearest(0, 0)) for offer in offers for each in offer.sizes if not each.is_range
    )
    fast = [
        f"{width}x{height}"
        for (width, height), rates in _rates(discrete, rates_of).items()
        if rates.values and rates.reaches(wish.rate_hz or 0.0)
    ]
    elsewhere = f" ({wish.rate_hz:g} Hz at {_joined(fast)})" if fast else ""
    return SourceError(f"rate {wish.rate_hz:g} Hz is not offered; offered: {words}{elsewhere}")


def _rates(
    sized: Iterable[tuple[Offer, tuple[int, int]]], rates_of: RatesOf
) -> dict[tuple[int, int], Rates]:
    """Return the rates of each size in the format in which it is fastest."""
    found: dict[tuple[int, int], Rates] = {}
    for offer, size in sized:
        rates = rates_of(offer.fourcc, *size)
        if size not in found or (rates.fastest or 0.0) > (found[size].fastest or 0.0):
            found[size] = rates
    return found


def _joined(texts: Iterable[str]) -> str:
    listed = list(dict.fromkeys(texts))
    more = len(listed) - MOST_NAMED
    return ", ".join(listed[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
