"""The parameters of a stream's URL, with the names and the meaning of web_video_server's."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from services.viewer.rendering import MAX_PIXELS, MAX_SIDE, Form

TYPES = ("mjpeg", "ros_compressed", "png")
YES = ("", "1", "true", "yes", "on")
NO = ("0", "false", "no", "off")
IGNORED = ("token", "qos_profile")
NAMES = ("topic", "type", "width", "height", "quality", "invert", "default_transport")
TRANSPORTS = ("raw", "compressed")


class BadQuery(Exception):
    """A parameter that is not allowed; says which and what would be."""


@dataclass(frozen=True, slots=True)
class StreamQuery:
    """What a URL asks for.

    Attributes:
        topic: As given.
        form: How its pictures are wanted.
        raw: A topic that is both raw and compressed is meant as raw.
    """

    topic: str
    form: Form
    raw: bool


def stream_query(given: Mapping[str, str], *, one: bool = False) -> StreamQuery:
    """Return what the parameters of a URL ask for.

    Args:
        given: By name.
        one: A single picture is asked for; its ``type`` says its format too.

    Raises:
        BadQuery: One is missing, mistyped, or has a value that is not allowed.
    """
    for name in given:
        # Pages add parameters of their own against caches, so only what is near is a mistake.
        near = difflib.get_close_matches(name, NAMES, 1)
        if near and name not in (*NAMES, *IGNORED):
            raise BadQuery(
                f"unknown parameter {name[:40]!r}; did you mean {near[0]}? "
                f"allowed: {', '.join(NAMES)}"
            )
    topic = given.get("topic", "")
    if not topic:
        raise BadQuery("topic is missing; allowed: such as topic=/front/image/compressed")
    kind = given.get("type", "mjpeg")
    allowed = (*TYPES, "jpeg") if one else TYPES
    if kind not in allowed:
        raise BadQuery(f"type = {kind!r} is not allowed; allowed: {', '.join(allowed)}")
    transport = given.get("default_transport", "compressed")
    if transport not in TRANSPORTS:
        raise BadQuery(
            f"default_transport = {transport!r} is not allowed; allowed: {', '.join(TRANSPORTS)}"
        )
    raw = transport == "raw"
    width, height = number("width", given, MAX_SIDE), number("height", given, MAX_SIDE)
    if width and height and width * height > MAX_PIXELS:
        raise BadQuery(
            f"width x height = {width * height} pixels are not allowed; allowed: {MAX_PIXELS}"
        )
    quality, invert = number("quality", given, 100), _invert(given)
    if kind == "ros_compressed":  # the bytes that the camera sent, whatever else is asked
        return StreamQuery(topic, Form(), raw)
    form: Literal["jpeg", "png"] = "png" if kind == "png" else "jpeg"
    return StreamQuery(topic, Form(width, height, False, quality, invert, form), raw)


def number(name: str, given: Mapping[str, str], most: int) -> int | None:
    """Return a whole number from 1 on; None if it is not given, or is -1 as in ROS.

    Raises:
        BadQuery: It is none.
    """
    text = given.get(name, "-1")
    if text == "-1":
        return None
    if not (text.isascii() and text.isdecimal() and len(text) < 6 and 1 <= int(text) <= most):
        raise BadQuery(
            f"{name} = {text[:40]!r} is not allowed; allowed: a whole number from 1 to {most}"
        )
    return int(text)


def _invert(given: Mapping[str, str]) -> bool:
    text = given.get("invert")
    if text is None or text.lower() in NO:
        return False
    if text.lower() not in YES:
        raise BadQuery(f"invert = {text[:40]!r} is not allowed; allowed: true, false")
    return True
