"""Draws frames with truth, tracks and errors, to be looked at."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.quality.tracker.comparison import Comparison, Result
from benchmarks.quality.tracker.scoring import overlaps
from benchmarks.quality.tracker.sequence import Shot, Shots

WHITE, BLACK, RED, GREY = (255, 255, 255), (0, 0, 0), (0, 0, 255), (160, 160, 160)


def colour(identity: int) -> tuple[int, int, int]:
    """Return a bright colour for an id, far from those of the neighbouring ids."""
    hsv = np.array([[[identity * 67 % 180, 220, 255]]], np.uint8)
    blue, green, red = cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR)[0, 0].tolist()
    return blue, green, red


def drawn(shot: Shot, result: Result) -> NDArray[np.uint8]:
    """Return a frame, enlarged twice, with the true and the found boxes.

    White: truth with its id below; red if nothing fits it. In colour, with the id above: confirmed
    tracks, thick if it is the centroid. Grey: tentative (t) and lost (l) ones. Black: detections.
    """
    bgr = np.asarray(cv2.resize(shot.bgr, None, fx=2, fy=2), np.uint8)
    found = result.found["robust"]
    fits = overlaps(list(shot.truth.values()), list(found.boxes.values()))
    for detection in result.detections:
        _rectangle(bgr, detection.box, BLACK, 1)
    for index, (identity, box) in enumerate(shot.truth.items()):
        missed = not fits.size or fits[index].max() < 0.5
        _rectangle(bgr, box, RED if missed else WHITE, 1)
        _text(bgr, f"{identity}", box[0], box[1] + box[3] + 7, RED if missed else WHITE)
    for track in result.tracks:
        if track.state == "confirmed":
            thick = 4 if tuple(track.box) == found.centroid else 2
            _rectangle(bgr, track.box, colour(track.id), thick)
            _text(bgr, f"{track.id}", track.box[0], track.box[1] - 2, colour(track.id))
        else:
            _rectangle(bgr, track.box, GREY, 1)
            _text(bgr, f"{track.id}{track.state[0]}", track.box[0], track.box[1] - 2, GREY)
    _text(bgr, f"{shot.index}", 2, 12, WHITE)
    return bgr


def write_pictures(
    folder: Path, shots: Shots, comparison: Comparison, indices: Sequence[int]
) -> None:
    """Write some frames of a sequence as PNG, and its errors as text."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.png"):
        old.unlink()
    wanted = set(indices)
    for shot in shots():
        if shot.index in wanted:
            picture = drawn(shot, comparison.results[shot.index])
            cv2.imwrite(str(folder / f"{shot.index:05}.png"), picture)
    rows = [
        f"{index}\t{kind}\t{'' if truth is None else truth}\t{'' if found is None else found}"
        for index, kind, truth, found in comparison.scorers["robust"].errors()
    ]
    text = "\n".join(["picture\terror\tid in truth\tid found", *rows, ""])
    (folder / "errors.tsv").write_text(text)


def indices_to_draw(comparison: Comparison, step: int, most: int = 60) -> list[int]:
    """Return each ``step``-th picture, and those around switches of identity."""
    known = sorted(comparison.results)
    regular = {index for index in known if index % step == 0}
    switches = [row[0] for row in comparison.scorers["robust"].errors() if row[1] == "SWITCH"]
    around = {known[max(0, known.index(index) - 1)] for index in switches[:most]} | set(
        switches[:most]
    )
    return sorted(regular | around)


def _rectangle(
    bgr: NDArray[np.uint8], box: Sequence[float], bgr_colour: tuple[int, int, int], thick: int
) -> None:
    x, y, width, height = (round(2 * value) for value in box)
    cv2.rectangle(bgr, (x, y), (x + width, y + height), bgr_colour, thick)


def _text(
    bgr: NDArray[np.uint8], text: str, x: float, y: float, bgr_colour: tuple[int, int, int]
) -> None:
    place = (round(2 * x), round(2 * y))
    cv2.putText(bgr, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, BLACK, 3, cv2.LINE_AA)
    cv2.putText(bgr, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, bgr_colour, 1, cv2.LINE_AA)
