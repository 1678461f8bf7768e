"""Render docs/images/overview.png: the streams of one camera at one moment.

The synthetic camera's pictures go through the same code as in the running system, without the
network: JPEG, tracker, edge detector. Run it from the top of the repository:

    .venv/bin/python docs/images/make_overview.py
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Header
from zv.camera.convert import Converter
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import open_source
from zv.edge.finding import EdgesOfFrame
from zv.edge.settings import EdgeSettings
from zv.tracker.pipelines.largest import LargestObject, draw
from zv.tracker.service import parameters_of
from zv.tracker.settings import TrackerSettings

TARGET = Path(__file__).parent / "overview.png"
SHOWN_FRAME = 180
GAP = 6
LABEL_HEIGHT = 26
LABEL_PAPER = 245
INK = (40, 40, 40)


def main() -> None:
    """Render the pictures and write the file."""
    settings = CameraSettings()
    source = open_source(settings, lambda: settings)
    converter = Converter()
    tracker = LargestObject(parameters_of(TrackerSettings()))
    for seq in range(SHOWN_FRAME + 1):
        picture = source.read()
        assert picture is not None
        header = Header(
            camera="front",
            epoch=0,
            seq=seq,
            stamp_ns=0,
            width=picture.width,
            height=picture.height,
            encoding=settings.encoding,
        )
        sent = converter.frame(header, picture, flip=settings.flip, quality=settings.quality)
        frame = Frame(header, compressed=sent.compressed)
        found, mask = tracker.update(frame.bgr)
    pictures = {
        "vision/front/image/compressed": frame.bgr,
        "vision/front/tracked/compressed": draw(frame.bgr, found),
        "vision/front/mask/compressed": cv2.cvtColor(mask, cv2.COLOR_GRAY2BGR),
        "vision/front/edges/compressed": cv2.cvtColor(
            EdgesOfFrame(frame, EdgeSettings()).edges, cv2.COLOR_GRAY2BGR
        ),
    }
    tiles = [labelled(np.asarray(pixels, np.uint8), key) for key, pixels in pictures.items()]
    rows = [beside(tiles[:2]), beside(tiles[2:])]
    gap = np.full((GAP, rows[0].shape[1], 3), LABEL_PAPER, np.uint8)
    montage = np.vstack([rows[0], gap, rows[1]])
    smaller = cv2.resize(montage, None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(TARGET), smaller, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def labelled(pixels: NDArray[np.uint8], key: str) -> NDArray[np.uint8]:
    """Return a picture with its key written above it."""
    label = np.full((LABEL_HEIGHT, pixels.shape[1], 3), LABEL_PAPER, np.uint8)
    cv2.putText(label, key, (4, 19), cv2.FONT_HERSHEY_SIMPLEX, 0.6, INK, 1, cv2.LINE_AA)
    return np.vstack([label, pixels])


def beside(tiles: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Return two pictures side by side."""
    gap = np.full((tiles[0].shape[0], GAP, 3), LABEL_PAPER, np.uint8)
    return np.hstack([tiles[0], gap, tiles[1]])


if __name__ == "__main__":
    main()
