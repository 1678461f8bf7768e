"""Render docs/images/overview.png: the streams of one camera at one moment.

The synthetic camera's pictures go through the same code as in the running system, without the
network: JPEG, tracker, edge detector. Run it from the top of the repository:

    .venv/bin/python -m docs.images.make_overview
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from docs.images.make_tuning import LABEL_PAPER, frames, labelled
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.picture import picture_of
from zv.camera.settings import CameraSettings
from zv.edge.finding import EdgesOfFrame
from zv.edge.settings import EdgeSettings
from zv.tracker.camera_tracking import largest_parameters
from zv.tracker.pipelines.largest import LargestObject, draw
from zv.tracker.settings import TrackerSettings

TARGET = Path(__file__).parent / "overview.png"
SHOWN_FRAME = 180
GAP = 6


def main() -> None:
    """Render the pictures and write the file."""
    tracker = LargestObject(largest_parameters(TrackerSettings(pipeline="tutorial")))
    for made in frames(SHOWN_FRAME + 1, CameraSettings()):
        frame = Frame(made.header, picture_of(made.compressed))
        found, mask = tracker.update(frame.bgr)
    edges = EdgesOfFrame(frame, EdgeSettings()).edges
    tiles = [
        labelled(pixels, f"vision/front/{topic}/compressed")
        for topic, pixels in {
            "image": np.asarray(frame.bgr, np.uint8),
            "tracked": draw(frame.bgr, found),
            "mask": cv2.cvtColor(mask, cv2.COLOR_GRAY2BGR),
            "edges": cv2.cvtColor(edges, cv2.COLOR_GRAY2BGR),
        }.items()
    ]
    space = np.full((tiles[0].shape[0], GAP, 3), LABEL_PAPER, np.uint8)
    upper, lower = (np.hstack([left, space, right]) for left, right in (tiles[:2], tiles[2:]))
    gap = np.full((GAP, upper.shape[1], 3), LABEL_PAPER, np.uint8)
    picture = np.vstack([upper, gap, lower])
    smaller = cv2.resize(picture, None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(TARGET), smaller, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    main()
