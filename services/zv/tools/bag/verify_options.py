"""The options of ``zv bag verify``."""

from __future__ import annotations

import shlex
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.settings import NAME_FORM, Argument, Letter
from zv.tools.shared.options import SECONDS, ToolOptions


def assigned(text: str) -> tuple[str, str]:
    """Return name and value of ``NAME=VALUE``.

    Raises:
        ValueError: The text has another form.
    """
    name, separator, value = text.partition("=")
    if not name or not separator:
        raise ValueError("not NAME=VALUE")
    return name.strip(), value.strip()


def _command(text: str) -> str:
    if not shlex.split(text):
        raise ValueError("no command")
    return text


def _assignments(texts: tuple[str, ...]) -> tuple[str, ...]:
    for text in texts:
        assigned(text)
    return texts


def _tolerances(texts: tuple[str, ...]) -> tuple[str, ...]:
    for text in texts:
        value = text.partition("=")[2] or text
        if not float(value) >= 0:
            raise ValueError("not a number of at least 0")
    return texts


class VerifyOptions(ToolOptions):
    """Options of ``zv bag verify``."""

    file: Annotated[str, Argument("FILE.mcap"), Field(description="the recording")]
    node: Annotated[
        str,
        Field(
            pattern=r"^[a-z0-9_]+$",
            description="the service, or the node, whose results are compared: tracker, "
            "tracker_front",
        ),
        NAME_FORM,
    ]
    command: Annotated[
        str | None,
        AfterValidator(_command),
        Field(description="command that starts a service of your own: 'python brightness.py'"),
    ] = None
    config: Annotated[
        str | None, Field(description="TOML file with settings, instead of the recorded ones")
    ] = None
    set_: Annotated[
        tuple[str, ...],
        AfterValidator(_assignments),
        Field(description="NAME=VALUE: a setting that differs; may be repeated"),
    ] = ()
    tolerance: Annotated[
        tuple[str, ...],
        AfterValidator(_tolerances),
        Field(
            description="FIELD=VALUE, or VALUE for all floats: by how much numbers may differ; "
            "tracks.x=0.5, pixels=0.001 for the share of pixels; may be repeated"
        ),
        Form("FIELD=NUMBER, or NUMBER"),
    ] = ()
    ignore: Annotated[
        tuple[str, ...], Field(description="field that is not compared; may be repeated")
    ] = ()
    all_frames: Annotated[
        bool,
        Field(
            description="send the frames too that the node did not answer when it was recorded, "
            "since it was too slow or not yet started"
        ),
    ] = False
    answer: Annotated[
        float, Field(gt=0, le=86400, description="how long the node may take for a frame"), SECONDS
    ] = 30.0
    picture: Annotated[
        str | None,
        Field(description="PNG file of the first difference; default: FILE.difference.png here"),
    ] = None
    update: Annotated[
        str | None,
        Letter("o"),
        Field(
            description="write a recording with the results of now in place of the recorded ones, "
            "and compare nothing"
        ),
    ] = None

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.update is not None and (self.tolerance or self.ignore or self.picture):
            raise ValueError("--update compares nothing: give it without --tolerance and the like")
        return self
