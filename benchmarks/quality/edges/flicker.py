"""Measures how steady the edges of a still scene are from frame to frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from zv.edge.detectors.detection import Detector

FRAMES = 12
NOISE = 4.0  # grey levels: a small sensor indoors
MOVED = 10  # grey levels between two frames after smoothing


def in_its_form(detector: Detector, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a BGR picture in the form that the detector needs."""
    if detector.wants == "bgr":
        return picture
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)


def still_scene() -> Iterator[NDArray[np.uint8]]:
    """Yield frames of 640 x 480 of 60 coloured ellipses, with new noise in each."""
    random = np.random.default_rng(0)
    scene = np.full((480, 640, 3), 110, np.uint8)
    for _ in range(60):
        middle = [int(each) for each in random.integers(0, (640, 480))]
        axes = [int(each) for each in random.integers(10, 90, 2)]
        colour = [int(each) for each in random.integers(20, 236, 3)]
        cv2.ellipse(scene, middle, axes, float(random.uniform(0, 180)), 0, 360, colour, -1)
    smooth = cv2.GaussianBlur(scene, (0, 0), 0.8).astype(np.float32)
    for _ in range(FRAMES):
        noisy = smooth + random.normal(0, NOISE, smooth.shape)
        yield np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def video(path: Path) -> Iterator[NDArray[np.uint8]]:
    """Yield every other of the first frames of a video, BGR."""
    with av.open(str(path)) as container:
        for number, frame in enumerate(container.decode(video=0)):
            if number == 2 * FRAMES:
                return
            if number % 2 == 0:
                yield np.asarray(frame.to_ndarray(format="bgr24"), np.uint8)


def still_pixels(before: NDArray[np.uint8], after: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return where nothing moves between two frames, 15 pixels around included."""
    smooth = [cv2.GaussianBlur(each, (0, 0), 2) for each in (before, after)]
    moved = (cv2.absdiff(*smooth).max(axis=2) > MOVED).astype(np.uint8)
    return np.asarray(cv2.dilate(moved, np.ones((31, 31), np.uint8)) == 0)


def flicker(detector: Detector, frames: Iterable[NDArray[np.uint8]]) -> tuple[float, float]:
    """Return the share of edges that are missing in the next frame, and the density of edges.

    An edge pixel persists if the next frame has one within a pixel, diagonals included. Only
    pixels where nothing moves count.
    """
    gone = edges = pixels = 0
    last: tuple[NDArray[np.uint8], NDArray[np.uint8]] | None = None
    for frame in frames:
        found = detector.detect(in_its_form(detector, frame)).edges
        if last is not None:
            still = still_pixels(last[0], frame)
            near = cv2.dilate(found, np.ones((3, 3), np.uint8)) > 0
            before = (last[1] > 0) & still
            gone += int((before & ~near).sum())
            edges += int(before.sum())
            pixels += int(still.sum())
        last = frame, found
    return gone / max(edges, 1), edges / max(pixels, 1)
