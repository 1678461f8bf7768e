"""Turns the shapes of the settings with the picture of a camera that is rotated or mirrored."""

from __future__ import annotations

import logging
import re
from typing import Final

from zenoh_vision import Frame, Node
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.image.turn import Size, Turn
from zenoh_vision.messages import Level
from zv.tracker.settings import TrackerSettings
from zv.tracker.shapes import NUMBER, Line, Polygon, lines, polygons

log = logging.getLogger(__name__)

NAMES: Final = ("zones", "lines", "regions", "ignore")
"""The settings that are shapes."""

PLACE: Final = re.compile(rf"(?P<x>{NUMBER.pattern})\s*,\s*(?P<y>{NUMBER.pattern})", re.IGNORECASE)
"""A point in a text of shapes."""

SHAPE: Final = re.compile(r"[^;#\n]+|#[^\n]*")
"""A shape or a comment."""

SHARED = "they are also those of other cameras"
PARTLY = "the camera has a region, or its picture has another size"
UNCHANGED = (
    "{camera}: the picture is {turn}, but {shapes} are not turned with it, since {reason}: set "
    "them again, or set rotate and flip of the camera back"
)


class TurnedShapes:
    """Keeps the shapes of a tracker at their places in the scene while the camera turns.

    The settings of the start hold for the orientation with which the camera was started, and
    shapes that are set later hold for the picture as it is then. When it is turned, their texts are
    turned too, as a new revision of the parameters. If they cannot be, the health says so.
    """

    def __init__(self, node: Node, camera: str, settings: TrackerSettings) -> None:
        self._node = node
        self._camera = camera
        self._texts = texts_of(settings)
        self._turns = dict.fromkeys(NAMES, Turn())
        self._sizes: dict[str, Size] = {}
        self._settings: TrackerSettings | None = None
        self._seen: tuple[Turn, Size] | None = None
        self._reported = ""

    def follow(self, frame: Frame) -> None:
        """Turn the shapes if a frame shows another orientation than that for which they are.

        Args:
            frame: The next frame; it gets the new revision of the parameters.
        """
        settings: TrackerSettings = frame.revision.settings
        size, turn = (frame.header.width, frame.header.height), Turn.of_header(frame.header)
        if settings is self._settings and (turn, size) == self._seen:
            return
        texts = texts_of(settings)
        for name in NAMES:
            if texts[name] != self._texts[name] or not pixel_shapes(name, texts[name]):
                self._turns[name] = turn
            if self._turns[name] == turn:
                self._sizes[name] = size
        self._texts = texts
        others = [name for name in NAMES if self._turns[name] != turn]
        reason = self._turn(frame, others, turn, size) if others else ""
        self._report(others, turn, reason)
        self._settings, self._seen = frame.revision.settings, (turn, size)

    def _turn(self, frame: Frame, names: list[str], turn: Turn, size: Size) -> str:
        """Turn the shapes of some settings, and return why that is impossible; else empty."""
        if len(frame.revision.settings.cameras) != 1:
            return SHARED
        texts = {}
        for name in names:
            further = turn.since(self._turns[name])
            before = further.inverse.size(size)
            if self._sizes.get(name, before) != before:
                return PARTLY
            texts[name] = turned(name, self._texts[name], further, before)
        store = self._node.parameters
        assert store is not None
        try:
            store.change(texts)
        except ParameterRefused as refused:
            return refused.error
        frame.revision = store.activate()
        self._texts = texts_of(frame.revision.settings)
        for name in names:
            log.info("%s of %s are turned with its picture: %s", name, self._camera, texts[name])
            self._turns[name], self._sizes[name] = turn, size
        return ""

    def _report(self, names: list[str], turn: Turn, reason: str) -> None:
        words = ""
        if reason:
            named = [f"{name} {', '.join(pixel_shapes(name, self._texts[name]))}" for name in names]
            further = turn.since(self._turns[names[0]])
            words = UNCHANGED.format(
                camera=self._camera, turn=further, shapes=" and ".join(named), reason=reason
            )
        if words != self._reported:
            self._reported = words
            if words:
                log.warning("%s", words)
            condition = f"shapes of {self._camera}"
            self._node.report(condition, Level.WARN if words else Level.OK, words)


def texts_of(settings: TrackerSettings) -> dict[str, str]:
    """Return the shapes of the settings."""
    return {name: getattr(settings, name) for name in NAMES}


def pixel_shapes(name: str, text: str) -> list[str]:
    """Return the names of the shapes of a setting that are in pixels."""
    found: tuple[Polygon | Line, ...] = lines(text) if name == "lines" else polygons(text)
    return [each.name for each in found if each.unit == "pixels"]


def turned(name: str, text: str, turn: Turn, size: Size) -> str:
    """Return a text of shapes for the picture that is turned.

    Objects still cross a line to the side of the same name: if the picture is mirrored, the two
    ends of a line are exchanged.

    Args:
        name: Of the setting.
        text: Its shapes; those in world units and comments stay as they are.
        turn: How the picture is turned.
        size: Its width and height before.
    """

    def shape(found: re.Match[str]) -> str:
        words = found[0]
        if words.startswith("#") or words.split()[1:2] == ["world"]:
            return words
        places = PLACE.finditer(words)
        points = [turn.point(float(each["x"]), float(each["y"]), size) for each in places]
        if name == "lines" and turn.mirrored:
            points.reverse()
        left = iter(points)
        return PLACE.sub(lambda _: ",".join(f"{number:.10g}" for number in next(left)), words)

    return SHAPE.sub(shape, text)
