"""What a page may ask over its WebSocket, checked."""

from __future__ import annotations

import json
from collections import deque
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from services.viewer.rendering import MAX_SIDE, Form

MAX_BYTES = 16 << 10
MAX_RATE_HZ = 50
MAX_SHOWN_HZ = 4000
"""Of ``shown``, which comes once a picture: 32 streams at 120 Hz."""

RATE_WINDOW_S = 1.0

Key = Annotated[str, Field(min_length=1, max_length=200)]
Name = Annotated[str, Field(min_length=1, max_length=128, pattern=r"^[a-z0-9_]+$")]
Number = Annotated[int, Field(ge=0, lt=2**53)]
Side = Annotated[int, Field(ge=1, le=MAX_SIDE)]


class Malformed(Exception):
    """A request that makes no sense; says why."""


class Request(BaseModel):
    """Base of all requests."""

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore", allow_inf_nan=False)


class Watch(Request):
    """Begin a stream, or go on with it in another form."""

    op: Literal["watch"]
    key: Key
    width: Side | None = None
    height: Side | None = None
    quality: Annotated[int, Field(ge=1, le=100)] | None = None

    @property
    def form(self) -> Form:
        """How its pictures are wanted."""
        return Form(self.width, self.height, inside=True, quality=self.quality)


class Unwatch(Request):
    """End a stream."""

    op: Literal["unwatch"]
    key: Key


class Shown(Request):
    """One picture was taken by the page."""

    op: Literal["shown"]
    key: Key


class Set(Request):
    """Change parameters of a node."""

    op: Literal["set"]
    id: Number
    node: Name
    values: Annotated[dict[str, bool | int | float | str | None], Field(min_length=1)]


class Dump(Request):
    """Get the parameters of a node as TOML."""

    op: Literal["dump"]
    id: Number
    node: Name


ADAPTER: TypeAdapter[Any] = TypeAdapter(
    Annotated[Watch | Unwatch | Shown | Set | Dump, Field(discriminator="op")]
)


def request_of(text: str) -> Watch | Unwatch | Shown | Set | Dump:
    """Return what a page asks.

    Raises:
        Malformed: It is no JSON, no request, or a field of it is not allowed.
    """
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        raise Malformed("no JSON; allowed: an object with op") from None
    try:
        found: Watch | Unwatch | Shown | Set | Dump = ADAPTER.validate_python(value)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "request"
        raise Malformed(f"{place}: {first['msg']}") from None
    return found


class Quota:
    """How much one page has sent in the last second."""

    def __init__(self) -> None:
        self._others: deque[float] = deque()
        self._shown: deque[float] = deque()

    def is_exceeded(self, asked: Request | Malformed, now_s: float) -> bool:
        """Count one more message, and tell whether that is too many.

        Args:
            asked: What it asks, or that it makes no sense.
            now_s: When it came, monotonic.
        """
        shown = isinstance(asked, Shown)
        times, most = (self._shown, MAX_SHOWN_HZ) if shown else (self._others, MAX_RATE_HZ)
        times.append(now_s)
        while times[0] < now_s - RATE_WINDOW_S:
            times.popleft()
        return len(times) > most
