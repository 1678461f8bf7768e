"""Render docs/images/tuning.png: what three parameters do, before and after.

The synthetic camera's pictures go through the same code as in the running system. Run it from the
top of the repository:

    .venv/bin/python -m docs.images.make_tuning
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Header
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import SourceOpener
from zv.edge.finding import EdgesOfFrame
from zv.edge.settings import EdgeSettings
from zv.tracker.camera_tracking import largest_parameters
from zv.tracker.pipelines.largest import LargestObject
from zv.tracker.settings import TrackerSettings

TARGET = Path(__file__).parent / "tuning.png"
SHOWN_FRAME = 150
WIDTH, HEIGHT = 320, 240
GAP = 6
LABEL_HEIGHT = 24
LABEL_PAPER = 245
INK = (40, 40, 40)
NOISY = CameraSettings(width=WIDTH, height=HEIGHT, noise=8.0)

EDGES = [{"sigma": 0.6, "low": 20.0, "high": 40.0}, {"sigma": 1.8, "low": 40.0, "high": 100.0}]
TRACKING = [
    (
        {"var_threshold": 4.0, "closing": 0, "median": 0},
        {"var_threshold": 25.0, "closing": 0, "median": 5},
    ),
    ({"closing": 0}, {"closing": 20}),
]


def main() -> None:
    """Render the pictures and write the file."""
    rows = [
        [labelled(edges(each), text(each)) for each in EDGES],
        *([labelled(mask(each), text(each)) for each in pair] for pair in TRACKING),
    ]
    space = np.full((HEIGHT + LABEL_HEIGHT, GAP, 3), 255, np.uint8)
    lines = [np.hstack([before, space, after]) for before, after in rows]
    gap = np.full((GAP, lines[0].shape[1], 3), 255, np.uint8)
    picture = np.vstack([part for line in lines for part in (line, gap)][:-1])
    cv2.imwrite(str(TARGET), picture, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def frames(count: int, settings: CameraSettings = NOISY) -> list[Frame]:
    """Return the first frames of the synthetic scene."""
    source = SourceOpener()(settings, lambda: settings)
    found = []
    for seq in range(count):
        picture = source.read()
        assert picture is not None
        header = Header(
            camera="front",
            epoch=0,
            seq=seq,
            stamp_ns=0,
            width=settings.size[0],
            height=settings.size[1],
            encoding=picture.picture.encoding,
        )
        found.append(Frame(header, picture.picture))
    return found


def edges(values: dict[str, float]) -> NDArray[np.uint8]:
    """Return the edges of a frame with these settings."""
    found = EdgesOfFrame(frames(SHOWN_FRAME)[-1], EdgeSettings(**values), None)
    return cv2.cvtColor(found.edges, cv2.COLOR_GRAY2BGR)


def mask(values: dict[str, float]) -> NDArray[np.uint8]:
    """Return the foreground of a frame with these settings of the tutorial's pipeline."""
    settings = TrackerSettings(pipeline="tutorial", **values)
    tracker = LargestObject(largest_parameters(settings))
    for frame in frames(SHOWN_FRAME):
        _, found = tracker.update(frame.bgr)
    return cv2.cvtColor(found, cv2.COLOR_GRAY2BGR)


def text(values: dict[str, float]) -> str:
    """Return settings as they are typed."""
    return " ".join(f"{name}={value:g}" for name, value in values.items())


def labelled(picture: NDArray[np.uint8], words: str) -> NDArray[np.uint8]:
    """Return a picture with words above it."""
    label = np.full((LABEL_HEIGHT, picture.shape[1], 3), LABEL_PAPER, np.uint8)
    cv2.putText(label, words, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.42, INK, 1, cv2.LINE_AA)
    return np.vstack([label, picture])


if __name__ == "__main__":
    main()
