"""Knows what the source delivers, and refuses settings that do not fit it."""

from __future__ import annotations

import logging

from zenoh_vision.image.pixel_formats import DEEP
from zenoh_vision.image.turn import Size, Turn
from zv.camera.convert import check_depth
from zv.camera.geometry import Geometry
from zv.camera.reader import CapturedFrame
from zv.camera.settings import CameraSettings

KEEPS_DEPTH = (
    "the source delivers 16 bits (%s), published as 8; --encoding mono16 keeps them, "
    "16UC1 publishes them as depth in millimetres"
)
MOVED = (
    "region = {} shows another part of the scene, since the picture was {}; set region = {} for "
    "the part before"
)
KEEPS_METRES = (
    "the source delivers depth in metres (%s), published as 8 bits; --encoding 32FC1 keeps it"
)


class Delivery:
    """Tracks the kind and size of a source's pictures, and checks the settings against them.

    Attributes:
        moved: A text that says that the region was set before the picture was turned; else empty.
    """

    def __init__(self, kind: str, log: logging.Logger) -> None:
        self._follows = kind == "synthetic"  # the scene draws whatever is wanted
        self._resizes = kind == "device"
        self._log = log
        self._encoding: str | None = None
        self._settings: CameraSettings | None = None
        self._size = (0, 0)
        self._region = ""
        self._region_turn = Turn()
        self.moved = ""

    def check(self, wanted: CameraSettings) -> None:
        """Check that pictures can be published with these settings, once the first has arrived.

        Raises:
            ParameterRefused: Depth is requested and the source has none, or the region is outside
                of the pictures.
        """
        last = self._settings
        if last is None or self._encoding is None or self._follows:
            return
        check_depth(self._encoding, wanted.encoding)
        asked = wanted.width, wanted.height
        if self._resizes and asked != (last.width, last.height):
            if wanted.width and wanted.height:  # else the device decides
                wanted.geometry.check((wanted.width, wanted.height))
        elif (wanted.region, wanted.rotate) != (self._region, last.rotate):
            # Else the source changed its size: no reason to refuse.
            wanted.geometry.check(self._size)

    def note(self, captured: CapturedFrame) -> bool:
        """Record size and settings of a picture, and log what is new.

        Returns:
            Whether they are others than those of the picture before.

        Raises:
            ParameterRefused: The first picture does not fit the settings of the start.
        """
        picture, settings = captured.picture, captured.revision.settings
        if settings is self._settings and picture.size == self._size:
            return False
        self._settings, self._size = settings, picture.size
        if self._encoding is None:
            self._encoding = picture.encoding
            if captured.revision.number == 0:  # later settings may only drop frames
                self.check(settings)
            if picture.encoding in DEEP and settings.encoding not in DEEP:
                keeps = KEEPS_METRES if picture.encoding == "32FC1" else KEEPS_DEPTH
                self._log.warning(keeps, picture.encoding)
        if settings.region != self._region:
            self._region, self._region_turn = settings.region, settings.geometry.turn
            again = "" if picture.form is None else "; its JPEGs are encoded again"
            part = f"region {settings.region} of" if settings.region else "all of"
            size = "x".join(map(str, settings.geometry.turn.size(picture.size)))
            whole = f"{size}{again if settings.region else ''}"
            self._log.info("published from now on: %s %s", part, whole)
        self.moved = self._moved(settings.geometry, picture.size)
        return True

    def _moved(self, geometry: Geometry, size: Size) -> str:
        """Return in which way the region was moved by a turn of the picture; else empty."""
        further = geometry.turn.since(self._region_turn)
        if geometry.box is None or further == Turn():
            return ""
        before = further.box(geometry.box, self._region_turn.size(size))
        if before == geometry.box:
            return ""
        return MOVED.format(self._region, further, ",".join(map(str, before)))
