"""What tests of cameras behind URLs have in common."""

from __future__ import annotations

import time
from collections.abc import Callable

from zenoh_vision.errors import SourceLost
from zv.camera.sources.base import Source, TimedPicture

SHORT_S = 1.0
PATIENT_S = 30.0
SLACK_S = 20.0
"""What a busy machine may take; less than ``PATIENT_S``, or the time allowed would not count."""

Opened = Callable[..., Source]


def read_until_lost(source: Source) -> tuple[list[TimedPicture], str, float]:
    """Return the pictures, why there are no more, and how long the last wait was, seconds."""
    pictures: list[TimedPicture] = []
    try:
        while True:
            started_s = time.monotonic()
            picture = source.read()
            assert picture is not None, "a camera never ends regularly"
            pictures.append(picture)
    except SourceLost as lost:
        return pictures, str(lost), time.monotonic() - started_s
