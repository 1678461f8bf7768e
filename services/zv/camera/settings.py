"""The camera's options; flags, configuration files and live parameters derive from them."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.parameters import Live
from zenoh_vision.config.region import REGION_FORM, REGION_PATTERN, box_of
from zenoh_vision.config.settings import ServiceSettings, Text
from zenoh_vision.messages import Box
from zv.camera.synthetic.faults import parse_faults

REOPENS = Live("pixels", effect="a change opens a device or the synthetic scene again")

USUAL_PIXELS = 1920 * 1200

PixelEncodingName = Literal["mono8", "mono16", "bgr8", "rgb8", "bgra8", "rgba8", "16UC1", "32FC1"]


def _known_faults(text: str) -> str:
    parse_faults(text)
    return text


class CameraSettings(ServiceSettings):
    """Options of ``zv camera``."""

    env_prefix: ClassVar[str] = "ZV_CAMERA_"

    source: Annotated[
        Text,
        Field(
            min_length=1,
            description="synthetic; a device (0, /dev/video0); a video file; a folder of images; "
            "a URL (rtsp://, http:// MJPEG)",
        ),
    ] = "synthetic"
    width: Annotated[
        int | None,
        Field(ge=16, le=7680, description="pixels; width of a device's or the synthetic picture"),
        REOPENS,
    ] = None
    height: Annotated[
        int | None,
        Field(ge=16, le=4320, description="pixels; height of a device's or the synthetic picture"),
        REOPENS,
    ] = None
    max_pixels: Annotated[
        int | None,
        Field(
            ge=16 * 16,
            le=7680 * 4320,
            description="limit of width times height, where both are set or the source is "
            "synthetic; not set: 1920x1200, or the size that the camera is started with if that is "
            "larger. The memory for a synthetic picture is up to 80 bytes a pixel",
        ),
    ] = None
    rate: Annotated[
        float | None,
        Field(
            ge=0.0001,
            le=1000,
            description="frames per second; not set: the source's own rate, 30 for synthetic, "
            "10 for a folder. Surplus frames of a faster live source are dropped",
        ),
        Live("Hz", effect="a device is opened again for a rate above its own"),
    ] = None
    fourcc: Annotated[
        str | None,
        Field(
            pattern="^[ -~]{4}$",
            description="pixel format requested from a device, such as MJPG or YUYV",
        ),
        Form("four characters"),
        Live(effect="a change opens a device again"),
    ] = None
    loop: Annotated[
        bool, Field(description="start a file or folder again at its end, in a new epoch"), Live()
    ] = False
    encoding: Annotated[
        PixelEncodingName,
        Field(
            description="pixel encoding of the published frames. 16UC1 and 32FC1 are depth in "
            "millimetres and metres, of synthetic or of grey pictures of 16 bits"
        ),
        Live(),
    ] = "bgr8"
    quality: Annotated[int, Field(ge=1, le=100, description="JPEG quality"), Live()] = 80
    max_kbps: Annotated[
        int | None,
        Field(
            ge=10,
            le=1_000_000,
            description="limit of what image/compressed takes of a link, 1000 bit/s; not set: no "
            "limit. First the quality falls, to 30, then the size, to a half and a quarter of each "
            "side, then the rate",
        ),
        Live("kbit/s"),
    ] = None
    flip: Annotated[
        Literal["none", "horizontal", "vertical", "both"],
        Field(description="mirror the picture; both rotates it by 180 degrees"),
        Live(),
    ] = "none"
    region: Annotated[
        str,
        Field(
            max_length=40,
            pattern=REGION_PATTERN,
            description="part of the picture that is published: X,Y,WIDTH,HEIGHT in pixels of the "
            "whole picture after flip; empty: all of it. A source's JPEGs are then not passed on, "
            "but encoded again",
        ),
        REGION_FORM,
        Live(),
    ] = ""
    calibration: Annotated[
        str | None,
        Field(
            min_length=1,
            description="calibration file, which zv calibrate or ROS wrote; it is published as "
            "camera_info. It holds for pictures of its shape, in the flip of the start",
        ),
    ] = None
    stall_after: Annotated[
        float,
        Field(ge=0.1, le=3600, description="time without a picture until a source is reopened"),
        Live("s"),
        SECONDS,
    ] = 5.0
    frozen_after: Annotated[
        float,
        Field(
            ge=0,
            le=3600,
            description="time of identical pictures until a live source is reopened; 0: never",
        ),
        Live("s"),
        SECONDS,
    ] = 10.0
    reopen_min: Annotated[
        float,
        Field(ge=0.01, le=60, description="delay before the first attempt to reopen"),
        Live("s"),
        SECONDS,
    ] = 0.5
    reopen_max: Annotated[
        float,
        Field(
            ge=0.01,
            le=3600,
            description="longest delay before an attempt; the delay doubles each time",
        ),
        Live("s"),
        SECONDS,
    ] = 10.0
    seed: Annotated[
        int,
        Field(ge=0, lt=2**32, description="random seed of the synthetic scene"),
        Live(effect="a change opens the synthetic scene again"),
    ] = 1
    noise: Annotated[
        float,
        Field(ge=0, le=50, description="sensor noise of the synthetic picture, grey levels"),
        Live("grey levels"),
    ] = 2.0
    objects: Annotated[
        int,
        Field(ge=0, le=16, description="moving objects in the synthetic picture"),
        Live(),
    ] = 4
    numbered: Annotated[
        bool,
        Field(
            description="draw the seq of each synthetic picture, modulo 65536, as coloured blocks "
            "in its corner, for measurements"
        ),
        Live(),
    ] = False
    faults: Annotated[
        str,
        Field(
            max_length=1000,
            description="faults of the synthetic camera for tests, in each epoch: "
            "KIND@FRAME+FRAMES separated by commas, such as stall@90+60; "
            "KIND: stall, frozen, drop, lighting; FRAME may be now",
        ),
        AfterValidator(_known_faults),
        Live(),
    ] = ""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the synthetic picture, pixels."""
        return self.width or 640, self.height or 480

    def limited(self) -> Self:
        """Return the settings with a limit of pixels for later changes.

        Anyone on the network can set width and height, and a large scene takes a container's
        memory.
        """
        if self.max_pixels is not None:
            return self
        width, height = self._known_size
        return self.model_copy(update={"max_pixels": max(USUAL_PIXELS, width * height)})

    @property
    def box(self) -> Box | None:
        """The region as x, y, width and height; None for the whole picture."""
        return box_of(self.region)

    @property
    def _known_size(self) -> tuple[int, int]:
        """Width and height if the settings determine both; (0, 0) if the source determines them."""
        if self.source == "synthetic":
            return self.size
        return (self.width, self.height) if self.width and self.height else (0, 0)

    @model_validator(mode="after")
    def _within_max_pixels(self) -> Self:
        width, height = self._known_size
        if self.max_pixels is not None and width * height > self.max_pixels:
            raise ValueError(
                f"{width}x{height} is over max_pixels = {self.max_pixels}; allowed: width times "
                "height at most max_pixels"
            )
        return self

    @model_validator(mode="after")
    def _region_within_scene(self) -> Self:
        if self.source == "synthetic" and self.box is not None:
            x, y, wide, high = self.box
            width, height = self.size
            if x + wide > width or y + high > height:
                raise ValueError(
                    f"region = {self.region} is not within the picture of {width}x{height}; "
                    f"allowed: X + WIDTH at most {width}, Y + HEIGHT at most {height}"
                )
        return self
