"""Commands of a page over its WebSocket: parsed, validated and rate-limited."""

from __future__ import annotations

from collections import deque
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from zv.viewer.streams.rendering import MAX_SIDE, Depth, RenderOptions

MAX_BYTES = 16 << 10
MAX_RATE_HZ = 50
MAX_SHOWN_HZ = 4000
"""Limit of ``shown``, which is sent once per picture: 32 streams at 120 Hz."""

RATE_WINDOW_S = 1.0

Key = Annotated[str, Field(min_length=1, max_length=200)]
Name = Annotated[str, Field(min_length=1, max_length=128, pattern=r"^[a-z0-9_]+$")]
Number = Annotated[int, Field(ge=0, lt=2**53)]
Side = Annotated[int, Field(ge=1, le=MAX_SIDE)]


class MalformedCommand(Exception):
    """A text that is not a valid command, with the reason."""


class PolicyViolation(Exception):
    """A page sent something other than text, or too many commands, and is disconnected."""


class Command(BaseModel):
    """Base of all commands."""

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore", allow_inf_nan=False)


class Watch(Command):
    """Begin a stream, or continue it with other render options."""

    op: Literal["watch"]
    key: Key
    width: Side | None = None
    height: Side | None = None
    quality: Annotated[int, Field(ge=1, le=100)] | None = None
    values: bool = False
    """Whether a picture of 16 bits is sent with its values; otherwise as grey."""

    @property
    def options(self) -> RenderOptions:
        """The options with which its pictures are rendered."""
        depth: Depth = "values" if self.values else "gray"
        return RenderOptions(self.width, self.height, fit=True, quality=self.quality, depth=depth)


class Unwatch(Command):
    """End a stream."""

    op: Literal["unwatch"]
    key: Key


class Shown(Command):
    """Report that the page has taken one picture."""

    op: Literal["shown"]
    key: Key


class Show(Command):
    """Set the kinds of text that the page's panels show; others are not sent to it."""

    op: Literal["show"]
    kinds: frozenset[Literal["health", "parameters", "log", "matches"]]


Values = dict[str, bool | int | float | str | None]


class SetParameters(Command):
    """Change parameters of a node, if those in ``expected`` still have these values."""

    op: Literal["set"]
    id: Number
    node: Name
    values: Annotated[Values, Field(min_length=1)]
    expected: Values = {}


class DumpParameters(Command):
    """Get the parameters of a node as TOML."""

    op: Literal["dump"]
    id: Number
    node: Name


AnyCommand = Watch | Unwatch | Shown | Show | SetParameters | DumpParameters
ADAPTER: TypeAdapter[AnyCommand] = TypeAdapter(Annotated[AnyCommand, Field(discriminator="op")])


def parse_command(text: str) -> AnyCommand:
    """Return the command in a text; MalformedCommand if there is none, or a field is wrong."""
    try:
        return ADAPTER.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "request"
        raise MalformedCommand(f"{place}: {first['msg']}") from None


class CommandReader:
    """Parses the commands of one page and limits their rate.

    Commands are counted by their parsed type; malformed ones count too.
    """

    def __init__(self) -> None:
        self._shown: deque[float] = deque()
        self._others: deque[float] = deque()

    def read(self, text: object, now_s: float) -> AnyCommand:
        """Return the command in a text that arrived at a monotonic time.

        Raises:
            MalformedCommand: As for ``parse_command``; the page gets an error message.
            PolicyViolation: It is not text, or there are too many commands in this second.
        """
        if not isinstance(text, str):
            raise PolicyViolation("only text messages are allowed")
        command: AnyCommand | None = None
        try:
            command = parse_command(text)
            return command
        finally:
            if isinstance(command, Shown):
                _limit(self._shown, MAX_SHOWN_HZ, now_s)
            else:
                _limit(self._others, MAX_RATE_HZ, now_s)


def _limit(times: deque[float], most: int, now_s: float) -> None:
    times.append(now_s)
    while times[0] < now_s - RATE_WINDOW_S:
        times.popleft()
    if len(times) > most:
        raise PolicyViolation(f"at most {most} such messages a second")
