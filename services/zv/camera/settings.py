"""The camera's options; flags, configuration files and live parameters derive from them."""

from __future__ import annotations

import json
import re
from functools import lru_cache
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.parameters import Live
from zenoh_vision.config.region import REGION_FORM, REGION_PATTERN, box_of
from zenoh_vision.config.settings import FromText, LocalPath, Secret, ServiceSettings, Text
from zenoh_vision.error_text import without_password
from zenoh_vision.errors import ParameterRefused
from zv.camera.geometry import Geometry
from zv.camera.synthetic.faults import parse_faults

REOPENS = Live("pixels", effect="a change opens a device or the synthetic scene again")

USUAL_PIXELS = 1920 * 1200

PixelEncodingName = Literal["mono8", "mono16", "bgr8", "rgb8", "bgra8", "rgba8", "16UC1", "32FC1"]


def _table(value: object) -> object:
    """Return the table in a text such as ``gain=40,auto_exposure=Manual Mode``, or in JSON.

    Raises:
        ValueError: The text has another form.
    """
    if not isinstance(value, str):
        return value
    if value.lstrip().startswith("{"):
        return json.loads(value)
    found: dict[str, bool | int | str] = {}
    for part in filter(None, map(str.strip, value.split(","))):
        name, equals, text = (each.strip() for each in part.partition("="))
        if not equals or not name:
            raise ValueError(f"{part!r} is not NAME=VALUE")
        found[name] = int(text) if INTEGER.fullmatch(text) else BOOLEANS.get(text, text)
    return found


INTEGER = re.compile(r"[+-]?[0-9]+")
BOOLEANS = {"true": True, "false": False}
CONTROLS_FORM = Form("a table, or NAME=VALUE,NAME=VALUE")
Controls = Annotated[dict[str, bool | int | str], BeforeValidator(_table)]


def _known_faults(text: str) -> str:
    parse_faults(text)
    return text


def _known_options(text: str) -> str:
    if text:
        from zv.camera.sources.libav_options import options_of  # loads PyAV

        options_of(text)
    return text


def _is_path(source: str) -> bool:
    """Tell whether a source is a file or a folder, by its form."""
    return not (
        source in ("synthetic", "-")
        or source.isdecimal()
        or source.startswith(("/dev/", "command:"))
        or "://" in source
        or without_password(source) != source  # a URL without its scheme
    )


class CameraSettings(ServiceSettings):
    """Options of ``zv camera``."""

    env_prefix: ClassVar[str] = "ZV_CAMERA_"

    source: Annotated[
        Text,
        Field(
            min_length=1,
            description="synthetic; a device (0, /dev/video0); a video file; a recording (.mcap); "
            "a folder of images; a URL (rtsp://, http:// MJPEG or picture); a program that writes "
            "a video to its output (command:PROGRAM ARGS)",
        ),
        LocalPath(_is_path),
    ] = "synthetic"
    username: Annotated[
        str | None,
        Field(max_length=200, description="user for a URL, as it is, without %-escapes"),
    ] = None
    password: Annotated[
        str | None,
        Field(
            max_length=200,
            description="password for a URL, as it is, without %-escapes. Set it in the "
            "environment or by password_file: everyone on a machine can read command lines",
        ),
        Secret(),
    ] = None
    password_file: Annotated[
        str | None,
        Field(min_length=1, description="file whose first line is the password for a URL"),
        LocalPath(),
    ] = None
    rtsp_transport: Annotated[
        Literal["auto", "tcp", "udp"],
        Field(description="transport of RTSP; auto: TCP, and UDP if the server refuses TCP"),
    ] = "auto"
    hwaccel: Annotated[
        str,
        Field(
            max_length=20,
            pattern="^[a-z0-9]+$",
            description="hardware that decodes the video of a URL: auto, none, or a kind that "
            "libav knows, such as cuda or vaapi; what it cannot decode, the CPU does",
        ),
        Form("letters a-z and digits"),
    ] = "auto"
    video_stream: Annotated[
        int,
        Field(ge=0, le=99, description="which of several videos in a file or a URL, from 0"),
    ] = 0
    libav_options: Annotated[
        str,
        Field(
            max_length=1000,
            description="options of libav for a URL: NAME=VALUE,NAME=VALUE",
        ),
        AfterValidator(_known_options),
    ] = ""
    max_lag: Annotated[
        float,
        Field(
            ge=0,
            le=3600,
            description="age of the packets of a live source from which those up to the newest key "
            "picture are skipped, and from which health warns; 0: never",
        ),
        Live("s"),
        SECONDS,
    ] = 0.5
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
    controls: Annotated[
        Controls,
        Field(
            description="values for the controls of a device, such as gain; zv camera --list names "
            "them. While the device is open, each is a live parameter: control.gain"
        ),
        CONTROLS_FORM,
    ] = {}  # noqa: RUF012 - pydantic copies it
    wait_for_source: Annotated[
        bool | None,
        Field(
            description="whether the node starts although its device or URL cannot be opened yet, "
            "and tries on; not set: yes under zv up, in containers and in systemd units, which "
            "set ZV_SUPERVISED, else no"
        ),
    ] = None
    loop: Annotated[
        bool, Field(description="start a file or folder again at its end, in a new epoch"), Live()
    ] = False
    lockstep: Annotated[
        str | None,
        Field(
            pattern="^[a-z0-9_]+(,[a-z0-9_]+)*$",
            description="nodes: the next frame of a file is published when all of them have "
            "answered the last one, so none is dropped however slow they are; stamps are the "
            "file's own times",
        ),
        Form("names of nodes, separated by commas"),
    ] = None
    wait_for: Annotated[
        int,
        Field(
            ge=0,
            le=1000,
            description="subscribers to wait for before the first frame, without a time limit, so "
            "that none of a file is lost",
        ),
    ] = 0
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
    rotate: Annotated[
        Literal[0, 90, 180, 270],
        FromText,
        Field(description="degrees clockwise by which the picture is rotated, before flip"),
        Live("degrees"),
    ] = 0
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
            "whole picture after rotate and flip; empty: all of it. A source's JPEGs are then not "
            "passed on, but encoded again",
        ),
        REGION_FORM,
        Live(),
    ] = ""
    calibration: Annotated[
        str | None,
        Field(
            min_length=1,
            description="calibration file, which zv calibrate, ROS or OpenCV wrote; it is "
            "published as camera_info. It holds for pictures of its shape, in the rotate and "
            "flip of the start",
        ),
        LocalPath(lambda value: "://" not in value),
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
            description="time of identical pictures of a live source until its health warns; "
            "0: never",
        ),
        Live("s"),
        SECONDS,
    ] = 10.0
    skip_repeats: Annotated[
        bool,
        Field(description="publish no picture of a live source that equals the one before it"),
        Live(),
    ] = False
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
    def geometry(self) -> Geometry:
        """How a frame shows what the source saw."""
        return _geometry(self.flip, self.region, self.rotate)

    @property
    def _known_size(self) -> tuple[int, int]:
        """Width and height if the settings determine both; (0, 0) if the source determines them."""
        if self.source == "synthetic":
            return self.size
        return (self.width, self.height) if self.width and self.height else (0, 0)

    @model_validator(mode="after")
    def _one_password(self) -> Self:
        if self.password is not None and self.password_file is not None:
            raise ValueError("password and password_file: only one of them is allowed")
        return self

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
        if self.source == "synthetic":
            try:
                self.geometry.check(self.size)
            except ParameterRefused as refused:
                raise ValueError(str(refused)) from None
        return self


@lru_cache(maxsize=4)
def _geometry(flip: str, region: str, rotate: int) -> Geometry:
    return Geometry(flip, box_of(region), rotate)
