"""The options of ``zv bag play``, and its parameters while it plays."""

from __future__ import annotations

import re
from typing import Annotated, Final, Self

from pydantic import AfterValidator, Field, model_validator

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.parameters import Live
from zenoh_vision.config.settings import Argument, Settings
from zenoh_vision.keys import NAME
from zv.tools.bag.options import check_part
from zv.tools.shared.options import SECONDS, ToolOptions

MAX_SPEED: Final = 100.0
MAX_S: Final = 10.0 * 365 * 86400


def renamed(text: str) -> dict[str, str]:
    """Return the new names by the old ones; the old name is empty in ``NAME`` alone.

    Raises:
        ValueError: The text has another form.
    """
    found: dict[str, str] = {}
    for part in text.split(","):
        old, separator, new = part.rpartition("=")
        if not re.fullmatch(NAME, new) or (separator and not re.fullmatch(NAME, old)):
            raise ValueError(f"{part!r} is neither NAME nor OLD=NEW")
        if separator and old in found:
            raise ValueError(f"camera {old} gets two names: {found[old]} and {new}")
        found[old] = new
    if "" in found and "," in text:
        raise ValueError("several cameras need OLD=NEW for each")
    if len(set(found.values())) < len(found):
        raise ValueError("two cameras get the same name")
    return found


def _checked(text: str) -> str:
    renamed(text)
    return text


class PlayerParameters(Settings):
    """What can change while a recording is played."""

    speed: Annotated[
        float,
        Field(
            ge=0, le=MAX_SPEED, description="multiple of the recorded pace; 0: as fast as possible"
        ),
        Live(),
    ] = 1.0
    paused: Annotated[bool, Field(description="the time of the recording stands still"), Live()] = (
        False
    )
    step: Annotated[
        int,
        Field(ge=0, le=2**31 - 1, description="each change sends the next frame while paused"),
        Live(),
    ] = 0
    position: Annotated[
        float,
        Field(ge=0, le=MAX_S, description="a change jumps there, seconds since the beginning"),
        Live("s"),
        SECONDS,
    ] = 0.0
    loop: Annotated[bool, Field(description="begin again at the end"), Live()] = False


class PlayOptions(ToolOptions):
    """Options of ``zv bag play``."""

    file: Annotated[str, Argument("FILE.mcap"), Field(description="the recording")]
    speed: Annotated[
        float | None,
        Field(
            ge=0,
            le=MAX_SPEED,
            description="multiple of the recorded pace; 0: as fast as possible; default: 1, with "
            "--lockstep 0",
        ),
    ] = None
    loop: Annotated[bool, Field(description="begin again at the end, until Ctrl-C")] = False
    start: Annotated[
        float, Field(ge=0, le=MAX_S, description="where to begin, since the first sample"), SECONDS
    ] = 0.0
    end: Annotated[
        float | None,
        Field(gt=0, le=MAX_S, description="where to end, since the first sample"),
        SECONDS,
    ] = None
    step: Annotated[bool, Field(description="begin paused; each step sends the next frame")] = False
    lockstep: Annotated[
        str | None,
        Field(
            pattern=r"^[a-z0-9_]+(,[a-z0-9_]+)*$",
            description="nodes, separated by commas: a camera's next frame is sent when all of "
            "them have answered its last one",
        ),
        Form("names of nodes, separated by commas"),
    ] = None
    answer: Annotated[
        float, Field(gt=0, le=86400, description="how long a node may take for a frame"), SECONDS
    ] = 30.0
    as_: Annotated[
        str | None,
        AfterValidator(_checked),
        Field(description="play as another camera: NAME, or OLD=NEW separated by commas"),
        Form("NAME, or OLD=NEW separated by commas"),
    ] = None
    now: Annotated[
        bool,
        Field(
            description="renew the stamps, as if the cameras were live; default: the original ones,"
            " marked as a replay"
        ),
    ] = False
    stay: Annotated[
        bool, Field(description="pause at the end instead of ending; playing begins again")
    ] = False
    timeline: Annotated[
        bool,
        Field(
            description="publish where the replay is, on a key replay of each camera, for the time "
            "line of a viewer"
        ),
    ] = False
    unmarked: Annotated[
        bool,
        Field(
            description="send the attachments byte by byte, without the mark of a replay; then "
            "frames are stale at other speeds, and out of order after a jump back"
        ),
    ] = False
    keys: Annotated[
        tuple[str, ...],
        Field(description="key expression of what is played; may be repeated; default: all but @"),
    ] = ()
    exclude: Annotated[
        tuple[str, ...], Field(description="key expression of what is not played; may be repeated")
    ] = ()

    _part = model_validator(mode="after")(check_part)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.now and self.unmarked:
            raise ValueError("--now needs new attachments: give --now or --unmarked")
        return self

    @property
    def nodes(self) -> tuple[str, ...]:
        """The nodes that are waited for."""
        return () if self.lockstep is None else tuple(self.lockstep.split(","))

    def parameters(self) -> PlayerParameters:
        """Return the parameters to begin with."""
        default = 0.0 if self.lockstep else 1.0
        return PlayerParameters(
            speed=default if self.speed is None else self.speed, paused=self.step, loop=self.loop
        )
