"""Scores thinned strengths of edges against boundaries drawn by people: ODS, OIS and AP.

As Berkeley's ``collect_eval_bdry``: the map above a threshold is thinned
and matched one to one with the lines of each person, at most 0.0075 of the diagonal apart. A found
pixel is right if it matches anybody's line; the recall counts everybody's lines. F is the harmonic
mean of precision and recall. ODS is the best F with one threshold for all images, OIS that with
the best threshold of each image, AP the area under precision over recall.

Source: D. Martin, C. Fowlkes, J. Malik, "Learning to Detect Natural Image Boundaries Using Local
Brightness, Color, and Texture Cues", 2004.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.quality.edges.matching import match, thin

REACH = 0.0075  # of the diagonal
DENSITIES = (0.0001, 0.0005, 0.002, 0.005, 0.01, 0.015, 0.02, 0.026, 0.033, 0.045, 0.065, 0.1)
"""Thresholds are those that give these shares of pixels over all images. People draw 0.03, so the
first recalls less than the first hundredth that ``ap`` counts, and the curve has no gap there."""

Counts = NDArray[np.float64]
"""(thresholds, 4): matched drawn pixels, drawn pixels, matched found pixels, found pixels."""


@dataclass(frozen=True, slots=True)
class Scores:
    """The scores of a detector; ``threshold`` is that of ``ods``."""

    ods: float
    ois: float
    ap: float
    threshold: float
    precision: float
    recall: float


def thresholds_of(strengths: Sequence[NDArray[np.float32]]) -> NDArray[np.float32]:
    """Return the thresholds that give ``DENSITIES`` over all maps, rising, without repetition."""
    found = np.sort(np.concatenate([each[each > 0] for each in strengths]))[::-1]
    pixels = sum(each.size for each in strengths)
    ranks = [round(density * pixels) for density in DENSITIES]
    return np.unique(found[[min(rank, found.size - 1) for rank in ranks]])


def count(
    strength: NDArray[np.float32],
    boundaries: Sequence[NDArray[np.bool_]],
    thresholds: NDArray[np.float32],
) -> Counts:
    """Match one image's map at each threshold with each person's boundaries."""
    counts = np.zeros((len(thresholds), 4))
    reach = REACH * float(np.hypot(*strength.shape))
    for row, threshold in zip(counts, thresholds, strict=True):
        found = thin(strength >= threshold)
        right = np.zeros(found.shape, bool)
        for drawn in boundaries:
            matched, number = match(found, drawn, reach)
            right |= matched
            row[0] += number
            row[1] += np.count_nonzero(drawn)
        row[2:] = np.count_nonzero(right), np.count_nonzero(found)
    return counts


def f_measure(precision: Counts, recall: Counts) -> Counts:
    """Return the harmonic mean, 0 where both are 0."""
    return 2 * precision * recall / np.maximum(precision + recall, 1e-12)


def curve(counts: Counts) -> tuple[Counts, Counts]:
    """Return precision and recall at each threshold."""
    return counts[:, 2] / np.maximum(counts[:, 3], 1), counts[:, 0] / np.maximum(counts[:, 1], 1)


def finer(values: Counts) -> Counts:
    """Interpolate 20 steps between neighbouring values, for the curve between two thresholds."""
    places = np.arange(len(values))
    steps = np.linspace(0, len(values) - 1, 20 * (len(values) - 1) + 1)
    return np.interp(steps, places, values)


def scores_of(counts: Sequence[Counts], thresholds: NDArray[np.float32]) -> Scores:
    """Return the scores of one detector from the counts of each image."""
    precision, recall = (finer(values) for values in curve(np.sum(counts, axis=0)))
    f = f_measure(precision, recall)
    best = int(f.argmax())
    each = [one[f_measure(*curve(one)).argmax()] for one in counts]
    own_precision, own_recall = curve(np.sum(each, axis=0)[None])
    order = np.argsort(recall, kind="stable")
    grid = np.linspace(0, 1, 101)
    heights = np.interp(grid, recall[order], precision[order], left=0, right=0)
    return Scores(
        ods=float(f[best]),
        ois=float(f_measure(own_precision, own_recall)[0]),
        ap=float(heights.sum() * 0.01),
        threshold=float(finer(thresholds.astype(np.float64))[best]),
        precision=float(precision[best]),
        recall=float(recall[best]),
    )
