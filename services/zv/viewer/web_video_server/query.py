"""Query parameters of a stream's URL, named and interpreted as in ROS's web_video_server."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from zv.viewer.streams.rendering import MAX_PIXELS, MAX_SIDE, RenderOptions

TYPES = ("mjpeg", "ros_compressed", "png")
YES = ("", "1", "true", "yes", "on")
NO = ("0", "false", "no", "off")
IGNORED = ("token", "qos_profile")
NAMES = ("topic", "type", "width", "height", "quality", "invert", "default_transport")
TRANSPORTS = ("raw", "compressed")


class InvalidQuery(Exception):
    """A parameter is not allowed; the text names it and what is allowed."""


@dataclass(frozen=True, slots=True)
class StreamQuery:
    """The stream that a URL requests, by its topic as given there."""

    topic: str
    options: RenderOptions
    raw: bool  # prefer raw pixels if the topic has raw and compressed pictures


def parse_query(given: Mapping[str, str], *, single: bool = False) -> StreamQuery:
    """Return the stream that parameters request; ``type`` of a single picture may be ``jpeg``.

    Raises:
        InvalidQuery: A parameter is missing, misspelt, or has a value that is not allowed.
    """
    for name in given:
        # Pages add their own parameters to bypass caches; only similar names are mistakes.
        near = difflib.get_close_matches(name, NAMES, 1)
        if near and name not in (*NAMES, *IGNORED):
            raise InvalidQuery(
                f"unknown parameter {name[:40]!r}; did you mean {near[0]}? "
                f"allowed: {', '.join(NAMES)}"
            )
    topic = given.get("topic", "")
    if not topic:
        raise InvalidQuery("topic is missing; allowed: such as topic=/front/image/compressed")
    kind = _choice("type", given, "mjpeg", (*TYPES, "jpeg") if single else TYPES)
    raw = _choice("default_transport", given, "compressed", TRANSPORTS) == "raw"
    width, height = _number("width", given, MAX_SIDE), _number("height", given, MAX_SIDE)
    if width and height and width * height > MAX_PIXELS:
        raise InvalidQuery(
            f"width x height = {width * height} pixels are not allowed; allowed: {MAX_PIXELS}"
        )
    quality, invert = _number("quality", given, 100), _invert(given)
    if kind == "ros_compressed":  # the bytes that the camera sent
        return StreamQuery(topic, RenderOptions(), raw)
    encoding: Literal["jpeg", "png"] = "png" if kind == "png" else "jpeg"
    options = RenderOptions(width, height, False, quality, invert, encoding)
    return StreamQuery(topic, options, raw)


def _choice(name: str, given: Mapping[str, str], default: str, allowed: tuple[str, ...]) -> str:
    text = given.get(name, default)
    if text not in allowed:
        raise InvalidQuery(f"{name} = {text!r} is not allowed; allowed: {', '.join(allowed)}")
    return text


def _number(name: str, given: Mapping[str, str], most: int) -> int | None:
    """Return a whole number from 1 to ``most``; None if it is not given, or is -1 as in ROS."""
    text = given.get(name, "-1")
    if text == "-1":
        return None
    if not (text.isascii() and text.isdecimal() and len(text) < 6 and 1 <= int(text) <= most):
        raise InvalidQuery(
            f"{name} = {text[:40]!r} is not allowed; allowed: a whole number from 1 to {most}"
        )
    return int(text)


def _invert(given: Mapping[str, str]) -> bool:
    text = given.get("invert")
    if text is None or text.lower() in NO:
        return False
    if text.lower() not in YES:
        raise InvalidQuery(f"invert = {text[:40]!r} is not allowed; allowed: true, false")
    return True
