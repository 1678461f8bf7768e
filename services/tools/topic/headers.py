"""Headers of what ``zv topic pub`` sends: made when it is sent, never taken from the user.

A stamp, epoch or number that was written down earlier would be a lie by the time it is sent.
"""

from __future__ import annotations

import time

from common.errors import ConfigurationError, PayloadError
from common.keys import is_name
from common.messages import Header
from services.tools.types import camera_of

SENDER = "topic_pub"
OURS = ("epoch", "seq", "stamp_ns", "received_ns", "done_ns", "node", "revision", "assumed")
"""Fields of the header that are made here."""


def new_header(
    camera: str, epoch: int, seq: int, size: tuple[int, int], encoding: str | None
) -> Header:
    """Return a header of this moment.

    Raises:
        ConfigurationError: The size is none.
    """
    try:
        return Header.from_map(
            {
                "camera": camera,
                "epoch": epoch,
                "seq": seq,
                "stamp_ns": time.time_ns(),
                "width": size[0],
                "height": size[1],
                "encoding": encoding,
                "node": SENDER,
            }
        )
    except PayloadError as error:
        raise ConfigurationError(error.detail) from None


def given_header(key: str, given: object) -> tuple[str, tuple[int, int] | None]:
    """Return the camera, and the size if the user's header has one.

    Raises:
        ConfigurationError: It states what is made here, or another camera than the key.
    """
    camera = camera_of(key) if key.count("/") > 1 else ""
    header = given if isinstance(given, dict) else {}
    if given is not None and not isinstance(given, dict):
        raise ConfigurationError(f"header must be a JSON object, not {given!r:.40}")
    if written := [name for name in header if name in OURS]:
        raise ConfigurationError(
            f"header.{written[0]} is made when the message is sent: leave it out"
        )
    camera = camera or str(header.get("camera", ""))
    if header.get("camera", camera) != camera:
        raise ConfigurationError(f"header.camera is {header['camera']!r} on a key of {camera}")
    if not is_name(camera):
        raise ConfigurationError(f"{camera!r} is no camera's name: allowed are a-z, 0-9 and _")
    if "width" not in header or "height" not in header:
        return camera, None
    return camera, (header["width"], header["height"])
