"""What each rule and each constant of the tracker is worth on the clips, and on clips left out.

Each clip is seen at 10 Hz, and so, mirrored and begun later; clips are measured in parallel.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from benchmarks.quality.tracker.clips import Clip, Robust, clips, measure, seen_otherwise
from benchmarks.quality.tracker.scoring import Score
from zv.tracker.pipelines.robust import RobustParameters

RULES: dict[str, dict[str, Any]] = {
    "the light": {"foreground.light.samples": 1, "foreground.light.better": 2.0},
    "steadying": {"foreground.steady.better": 0.0},
    "doubt of what shares a region": {"tracking.association.doubt": 0.0},
    "shadows left out": {"foreground.detect_shadows": False},
    "brightness of shadows from black": {"foreground.background.black": 50.0},
    "brightness in the distance": {"foreground.background.share": 0.0},
    "noise in the distance": {"foreground.background.noise": 0.0},
    "medians at the start": {"foreground.background.starts_s": (0.5,)},
    "strong pixels": {"region.strong": 0.0},
    "cutting thin ends": {"region.thin": 0.0},
    "joining pieces": {
        "tracking.association.pieces.stacked": -9.0,
        "tracking.association.pieces.beside": -9.0,
    },
    "ghosts": {"least_evidence": 0.0},
    "protection": {"tracking.life.protect_s": 0.0},
    "learning what stands unchanged": {"tracking.life.unchanged_s": 1e9},
    "proof before sharing": {"tracking.association.proven_s": 0.0},
    "confirmation within one motion": {"tracking.life.rest_s": 1e9},
    "seen for most of its age": {"tracking.life.seen_share": 0.0},
}
"""What each rule is, and the constants with which it does nothing."""

CONSTANTS = (
    "least_share",
    "foreground.background.base",
    "foreground.background.share",
    "foreground.background.noise",
    "region.strong",
    "tracking.life.confirm_s",
    "tracking.life.confirm_sides",
    "tracking.association.pieces.stacked",
    "tracking.association.pieces.beside",
    "tracking.association.proven_s",
)
"""Constants that are halved and doubled."""

AS_IT_IS = "as it is"
LEAST_MOTA = -60.0
"""Where most boxes are false, how many more they are says nothing of a rule."""

Scores = Mapping[str, Score]
"""By the name of a clip, in one of the ways in which it is seen."""


def changed(parameters: Any, path: str, value: Any) -> Any:
    """Return a dataclass with another value of a field of a field: ``region.thin``."""
    name, _, rest = path.partition(".")
    return replace(
        parameters, **{name: changed(getattr(parameters, name), rest, value) if rest else value}
    )


def alternatives() -> Iterator[tuple[str, RobustParameters]]:
    """Yield the product as it is, without each rule, and with each constant halved and doubled."""
    usual = RobustParameters()
    yield AS_IT_IS, usual
    for rule, changes in RULES.items():
        parameters = usual
        for path, value in changes.items():
            parameters = changed(parameters, path, value)
        yield f"without {rule}", parameters
    for path in CONSTANTS:
        value = usual
        for name in path.split("."):
            value = getattr(value, name)
        for factor in (0.5, 2.0):
            new = factor * value  # type: ignore[operator]
            yield f"{path} = {new:g}", changed(usual, path, new)


def results() -> Iterator[tuple[str, dict[str, Score]]]:
    """Yield the scores of each alternative, as soon as it is measured."""
    with ProcessPoolExecutor(os.cpu_count(), initializer=_load) as pool:
        waiting = [
            (name, {clip: pool.submit(_score, clip, parameters) for clip in _seen()})
            for name, parameters in alternatives()
        ]
        for name, scores in waiting:
            yield name, {clip: each.result() for clip, each in scores.items()}


def means(scores: Scores, *, without: str = "") -> tuple[float, float]:
    """Return the mean MOTA and IDF1 of the clips with objects, but one of them."""
    rows = [
        (max(each.mota, LEAST_MOTA), each.idf1)
        for name, each in scores.items()
        if each.boxes and (not without or name.partition(",")[0] != without)
    ]
    mota, idf1 = np.mean(rows, axis=0).tolist()
    return mota, idf1


def chosen(found: Mapping[str, Scores], left_out: str) -> str:
    """Return which alternative the other clips choose, without the one that is left out.

    Another one than the usual is chosen if it gains more than a point in the mean of MOTA and IDF1.
    """
    gains = {name: sum(means(scores, without=left_out)) / 2 for name, scores in found.items()}
    best = max(gains, key=lambda name: gains[name])
    return best if gains[best] > gains[AS_IT_IS] + 1.0 else AS_IT_IS


CLIPS: dict[str, Clip] = {}
"""The clips of this process, in each way in which they are seen."""


def _seen() -> dict[str, Clip]:
    if not CLIPS:
        CLIPS.update({each.name: each for clip in clips() for each in seen_otherwise(clip)})
    return CLIPS


def _load() -> None:
    cv2.setNumThreads(1)
    _seen()


def _score(clip: str, parameters: RobustParameters) -> Score:
    return measure(_seen()[clip], Robust(parameters))[0]
