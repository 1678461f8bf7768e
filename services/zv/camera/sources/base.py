"""The interface of a source, and the picture it delivers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from zenoh_vision.image.picture import Picture
from zenoh_vision.messages import Parameter, Track


@dataclass(frozen=True, slots=True)
class TimedPicture:
    """One picture as a source delivered it.

    Attributes:
        picture: In the form in which the source has it.
        stamp_ns: Capture time, ns since 1970; None if unknown.
        due_s: When to publish it, seconds on the source's own clock since its first picture; None
            for a source that paces itself or has no clock.
        truth: All objects in a synthetic picture; None for other sources.
        skipped: Number of pictures before this one that the source skipped, since they were old.
        lost: Number of pictures that the source took after the one before, and did not deliver.
        packets_lost: Number of packets that the network lost after the one before.
    """

    picture: Picture
    stamp_ns: int | None = None
    due_s: float | None = None
    truth: tuple[Track, ...] | None = None
    skipped: int = 0
    lost: int = 0
    packets_lost: int = 0


class Source(Protocol):
    """An open source. Its constructor raises ``SourceError``.

    The same thread must open, read and close it: C libraries crash if their memory is freed
    during a call.

    Attributes:
        description: For people: ``video file walk.avi (768x576, 10 Hz, MJPEG)``.
        live: Whether it paces itself (a device, a URL) instead of being paced by the camera.
        rate_hz: Its own rate, None if it has none.
    """

    description: str
    live: bool
    rate_hz: float | None

    def read(self) -> TimedPicture | None:
        """Return the next picture, or None at the normal end.

        Raises:
            SourceLost: The source stopped delivering, or delivers nothing usable.
        """

    def close(self) -> None:
        """Release the device, connection or file; safe to call twice."""


class Controls(Protocol):
    """The controls of a source while it is open; they become parameters of the node."""

    table: str

    def parameters(self) -> Sequence[Parameter]:
        """Return a description of each with its present value."""

    def set(self, values: Mapping[str, object]) -> Mapping[str, bool | int | float | str]:
        """Set some by name, all or none, and return the values to set at the next opening.

        Raises:
            ParameterRefused: A value is not allowed, or there is no such control.
        """

    def watch(self, told: Callable[[], None] | None) -> None:
        """Call a function after the source itself has changed one; None to end that."""


@runtime_checkable
class HasControls(Protocol):
    """A source with controls."""

    controls: Controls


@runtime_checkable
class OffersModes(Protocol):
    """A source that offers some formats, sizes and rates, and no others."""

    def check(self, wish: DeviceWish) -> None:
        """Refuse what it does not offer.

        Raises:
            SourceError: The text has the wish and what is offered.
        """


@runtime_checkable
class KnowsNextDue(Protocol):
    """A source that knows when its next picture is due before it draws the picture in ``read``."""

    def next_due_s(self) -> float | None:
        """Return when the next picture is due, as ``TimedPicture.due_s``; None if there is none.

        May block for as long as ``read`` may.
        """


@dataclass(frozen=True, slots=True)
class DeviceWish:
    """What a user asks of a device; None for its choice.

    Attributes:
        fourcc: Format, four characters.
        width: Pixels.
        height: Pixels.
        rate_hz: Pictures per second, at least.
        deep: Whether formats of 10 to 16 bits are preferred to others.
    """

    fourcc: str | None = None
    width: int | None = None
    height: int | None = None
    rate_hz: float | None = None
    deep: bool = False
