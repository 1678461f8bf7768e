"""The options of ``zv calibrate camera`` and ``zv calibrate plane``."""

from __future__ import annotations

import re
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.settings import Argument, CameraName, Letter
from zenoh_vision.keys import DEFAULT_CAMERA
from zv.tools.shared.options import SECONDS, ToolOptions

Pair = tuple[float, float, float, float]

NUMBER = r"[-+]?[0-9]+(?:\.[0-9]+)?(?:e[-+]?[0-9]+)?"
PAIR = re.compile(rf"({NUMBER}),({NUMBER})=({NUMBER}),({NUMBER})", re.IGNORECASE)
PAIR_WORDS = "x,y=X,Y, such as 120,80=0,0.5"


def pair_of(text: str) -> Pair:
    """Read a pair of a pixel and a place, ``x,y=X,Y``.

    Raises:
        ValueError: The text is not a pair.
    """
    found = PAIR.fullmatch(text.replace(" ", ""))
    if found is None:
        raise ValueError("not a pair")
    x, y, world_x, world_y = map(float, found.groups())
    return x, y, world_x, world_y


def _known_dictionary(name: str) -> str:
    from zv.tools.calibrate.board import DICTIONARIES  # loads OpenCV, which help does not need

    if name not in DICTIONARIES:
        raise ValueError(f"not one of {', '.join(DICTIONARIES)}")
    return name


def _pairs(texts: tuple[str, ...]) -> tuple[str, ...]:
    for text in texts:
        pair_of(text)
    return texts


class BoardOptions(ToolOptions):
    """The board, and where it is seen."""

    camera: Annotated[CameraName, Field(description="camera that sees the board")] = DEFAULT_CAMERA
    board: Annotated[
        Literal["chessboard", "charuco"],
        Field(description="charuco: a chessboard with markers, which may be partly hidden"),
    ] = "chessboard"
    size: Annotated[
        str | None,
        Field(
            pattern=r"^[0-9]{1,2}x[0-9]{1,2}$",
            description="columns and rows: inner corners of a chessboard, squares of a charuco",
        ),
        Form("COLUMNSxROWS, such as 9x6"),
    ] = None
    square: Annotated[
        float | None,
        Field(gt=0, description="side of a square, in the unit of positions in the world"),
    ] = None
    marker: Annotated[
        float | None,
        Field(gt=0, description="charuco: side of a marker; not set: 3/4 of a square"),
    ] = None
    dictionary: Annotated[
        str,
        AfterValidator(_known_dictionary),
        Field(description="charuco: OpenCV's dictionary of the markers, such as 5X5_100"),
    ] = "4X4_50"

    @model_validator(mode="after")
    def _possible_board(self) -> Self:
        if self.size is not None:
            columns, rows = self.columns_rows
            if min(columns, rows) < 3 or columns * rows > 1000:
                raise ValueError(
                    f"size {self.size} is no board; allowed: 3x3 and more, up to 1000 in all"
                )
        if self.marker is not None and self.square is not None and self.marker >= self.square:
            raise ValueError(f"marker {self.marker:g} is not below square {self.square:g}")
        return self

    @property
    def columns_rows(self) -> tuple[int, int]:
        """The two numbers of ``size``, which must be set."""
        columns, rows = (self.size or "").split("x")
        return int(columns), int(rows)


class CameraOptions(BoardOptions):
    """Options of ``zv calibrate camera``."""

    images: Annotated[
        str | None,
        Field(description="folder of pictures of the board; not set: the stream of the camera"),
    ] = None
    model: Annotated[
        Literal["plumb_bob", "rational_polynomial", "equidistant"],
        Field(
            description="distortion model, as named in ROS; equidistant: fisheye; "
            "rational_polynomial: wide-angle"
        ),
    ] = "plumb_bob"
    output: Annotated[
        str | None, Letter("o"), Field(description="file to write; not set: CAMERA.yaml")
    ] = None
    for_: Annotated[
        float,
        Field(gt=0, le=86400, description="longest time to take pictures from the stream"),
        SECONDS,
    ] = 300.0
    max_error: Annotated[
        float,
        Field(gt=0, le=100, description="exit status 1 if the reprojection error is above this"),
    ] = 1.0


class PlaneOptions(BoardOptions):
    """Options of ``zv calibrate plane``."""

    calibration: Annotated[
        str,
        Argument("FILE"),
        Field(description="calibration file of the camera, into which the plane is written"),
    ]
    pair: Annotated[
        tuple[str, ...],
        AfterValidator(_pairs),
        Form(PAIR_WORDS),
        Field(description="a pixel and its place in the world; given four times or more"),
    ] = ()
    pairs: Annotated[
        str | None, Field(description="file of pairs, one x,y=X,Y a line; # begins a comment")
    ] = None
    image: Annotated[
        str | None,
        Field(description="picture of a board on the plane; not set: the stream of the camera"),
    ] = None
    no_lens: Annotated[
        str | None,
        Field(
            pattern=r"^[0-9]{1,5}x[0-9]{1,5}$",
            description="write FILE anew, for a camera without distortion and of this size",
        ),
        Form("WIDTHxHEIGHT, such as 1280x720"),
    ] = None
    output: Annotated[
        str | None, Letter("o"), Field(description="file to write; not set: FILE itself")
    ] = None
    for_: Annotated[
        float,
        Field(gt=0, le=3600, description="time in which the stream must show the board"),
        SECONDS,
    ] = 30.0
    max_error: Annotated[
        float | None,
        Field(gt=0, description="exit status 1 if the error (rms) is above this, in world units"),
    ] = None
