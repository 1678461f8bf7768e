"""Makes pictures of the frames that libav has decoded; nothing is converted before it is wanted."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Final, Literal

import numpy as np
from av.video.format import VideoFormat
from av.video.frame import VideoFrame
from av.video.plane import VideoPlane
from av.video.reformatter import ColorRange, VideoReformatter
from numpy.typing import NDArray

from zenoh_vision.image.picture import Box, Picture, PixelPicture
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.image.planar import PlanarPicture, Plane, are_even
from zv.camera.sources.swscale import BgrWriter

STORED: Final = frozenset({"yuv420p", "yuvj420p"})
BT_601_SPACES: Final = frozenset({2, 5, 6})  # not stated, BT.470 BG, SMPTE 170M
"""Colour spaces of JPEG; libav assumes one of these if a stream states none."""

StoredForm = Literal["planes", "bgr"]


class FrameConverter:
    """Converts the frames of one stream; safe between threads.

    Attributes:
        bgr: Writes pixels to given memory.
        asked: The forms that were asked for of pictures since the newest was made.
    """

    def __init__(self) -> None:
        self.bgr = BgrWriter()
        self.asked: set[StoredForm] = set()
        self._reformatter = VideoReformatter()
        self._lock = threading.Lock()

    def picture(self, frame: VideoFrame) -> Picture:
        """Return a frame, upright, as a picture.

        Planes that a JPEG can store are left as they are. Grey pictures keep their depth (9 to 15
        bits are scaled up to 16); alpha is kept. All others are converted to BGR by the stream's
        colour space and range; if the stream states neither, the result equals OpenCV's.
        """
        planes = stored_planes(frame)
        if planes is None:
            return PixelPicture(self.pixels(frame))
        picture = VideoPicture(frame, planes, self)
        forms, self.asked = tuple(self.asked), set()  # a copy, since others may add to it
        picture.prepare(forms)  # before they are requested, as they were of earlier pictures
        return picture

    def pixels(self, frame: VideoFrame) -> NDArray[Any]:
        """Return new pixels of a frame, upright: (height, width[, channels])."""
        wanted = _pixel_format(frame.format)
        with self._lock:
            converted = self._reformatter.reformat(
                frame, format=wanted, src_color_range=frame.color_range, threads=1
            )
        pixels = converted.to_ndarray()
        if frame.rotation % 90 == 0 and frame.rotation % 360:
            pixels = np.rot90(pixels, frame.rotation // 90)
        if converted is frame or not pixels.flags.c_contiguous:
            pixels = pixels.copy()  # the decoder may still need its own
        return pixels


class VideoPicture(Picture):
    """A frame of a video, in libav's memory.

    ``planes`` are the frame's ``stored_planes``; the frame is kept.
    """

    def __init__(
        self, frame: VideoFrame, planes: tuple[VideoPlane, ...], converter: FrameConverter
    ) -> None:
        super().__init__("bgr8", frame.width, frame.height)
        self._frame = frame
        self._planes = planes
        self._converter = converter
        self._planar: PlanarPicture | None = None

    def prepare(self, forms: Iterable[StoredForm]) -> None:
        """Make forms that will probably be asked for."""
        for form in forms:
            if form == "planes":
                self._as_planar().prepare()
            else:
                super().pixels  # noqa: B018 - makes them

    @property
    def pixels(self) -> Pixels:
        """(height, width, 3) uint8, read-only; those of the next frames are prepared."""
        self._converter.asked.add("bgr")
        return super().pixels

    def jpeg(self, quality: int) -> bytes:
        """Return the picture as a JPEG; the planes of the next frames are prepared for theirs."""
        self._converter.asked.add("planes")
        return self._as_planar().jpeg(quality)

    def cropped(self, box: Box) -> Picture:
        """Return the part in a rectangle."""
        return self._new_planar(lambda: np.asarray(self.pixels, np.uint8)).cropped(box)

    def write(self, target: NDArray[np.uint8]) -> None:
        """Write the pixel rows to memory, converted into it if that is possible."""
        rows, made = target.reshape(self.height, self.width, 3), self._pixels
        full_range = _is_full_range(self._frame)
        if made is not None:
            np.copyto(rows, made)  # not ``pixels``, which would ask for those of the next frames
        elif not self._converter.bgr.write(self._planes, full_range=full_range, target=rows):
            np.copyto(rows, self.pixels)

    def _make_pixels(self) -> NDArray[np.uint8]:
        return np.asarray(self._converter.pixels(self._frame), np.uint8)

    def _equals(self, other: VideoPicture) -> bool:
        return self._as_planar().equals(other._as_planar())

    def _as_planar(self) -> PlanarPicture:
        with self._lock:
            if self._planar is None:
                # Not ``self.bgr``: two objects that refer to each other stay until Python looks for
                # such cycles, and the memory of dozens of frames with them.
                self._planar = self._new_planar(partial(self._converter.pixels, self._frame))
            return self._planar

    def _new_planar(self, to_bgr: Callable[[], NDArray[np.uint8]]) -> PlanarPicture:
        luma, blue, red = map(_array, self._planes)
        return PlanarPicture(
            (luma, blue, red), full_range=_is_full_range(self._frame), to_bgr=to_bgr
        )


def stored_planes(frame: VideoFrame) -> tuple[VideoPlane, ...] | None:
    """Return the planes of a frame if a JPEG can store them; None if its colours are others."""
    if (
        frame.format.name not in STORED
        or frame.colorspace not in BT_601_SPACES
        or frame.rotation % 360
    ):
        return None
    if not are_even(frame.height, frame.width):
        return None
    planes = frame.planes  # each access makes new objects
    if any(plane.line_size < plane.width for plane in planes):  # rows from bottom to top
        return None
    return planes


def _array(plane: VideoPlane) -> Plane:
    """Return a view of a plane without the padding of its rows; it keeps the frame's memory."""
    shape, strides = (plane.height, plane.width), (plane.line_size, 1)
    return np.ndarray(shape, np.uint8, memoryview(plane), strides=strides)


def _pixel_format(source: VideoFormat) -> str:
    """Return libav's name of the pixel format to convert to."""
    components = source.components
    if any(component.is_alpha for component in components):
        return "bgra"
    if source.has_palette or source.is_rgb or len(components) != 1:
        return "bgr24"
    return "gray16le" if components[0].bits > 8 else "gray"


def _is_full_range(frame: VideoFrame) -> bool:
    return frame.format.name == "yuvj420p" or frame.color_range == ColorRange.JPEG
