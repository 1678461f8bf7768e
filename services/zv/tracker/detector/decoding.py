"""Turns the outputs of a model for one picture into boxes, each published form in its own function.

All return boxes in pixels of the model's input. Candidates below the least score are left out
before anything else is computed of them: a model has up to 25,200.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from zv.tracker.detector.suppression import Candidates

Array = NDArray[np.float32]
Outputs = Mapping[str, Array]
"""The outputs for one picture by their names, without the dimension of the batch."""

Shapes = Mapping[str, tuple[int, ...]]
"""The shapes of outputs by their names."""

STRIDES = (8, 16, 32)
"""Pixels of the input per cell of each grid."""


@dataclass(frozen=True, slots=True)
class Facts:
    """What the decoding of a model's outputs needs."""

    size: tuple[int, int]  # width and height of the input
    classes: int = 0  # number of classes; 0 if it is only known by the outputs


def cells(size: tuple[int, int], strides: tuple[int, ...] = STRIDES) -> int:
    """Return the number of cells of all grids, as models without anchors have one box in each."""
    return sum(-(-size[0] // stride) * -(-size[1] // stride) for stride in strides)


def heads(shapes: Shapes, size: tuple[int, int]) -> list[tuple[str, str]]:
    """Return the names of the two outputs of each grid, the finest first; empty if that is not all.

    Args:
        shapes: Those of the outputs; the last but one is the number of cells.
        size: Width and height of the input.
    """
    found = []
    for stride in (*STRIDES, 64):
        here = [name for name in shapes if shapes[name][-2] == cells(size, (stride,))]
        if len(here) == 2:
            found.append((here[0], here[1]))
    return found if len(shapes) == 2 * len(found) > 4 else []


def best_classes(scores: Array, least: float) -> tuple[NDArray[np.intp], Array, NDArray[np.int64]]:
    """Return of the rows whose largest score is not too small: their indices, scores, classes.

    Args:
        scores: (n, classes).
        least: A smaller score is too small.
    """
    if scores.shape[1] == 0:
        return np.empty(0, np.intp), np.empty(0, np.float32), np.empty(0, np.int64)
    # NaN is kept, so that it is counted: comparisons with it are false.
    rows = np.flatnonzero(~(scores.max(axis=1) < least))
    kept = scores[rows]
    classes = kept.argmax(axis=1) if len(rows) else np.empty(0, np.intp)
    return rows, kept[np.arange(len(rows)), classes], classes.astype(np.int64)


def from_centres(boxes: Array) -> Array:
    """Convert (n, 4) centre x, centre y, width, height to left, top, right, bottom."""
    half = boxes[:, 2:4] / 2
    return np.concatenate([boxes[:, :2] - half, boxes[:, :2] + half], axis=1)


def scaled(boxes: Array, facts: Facts) -> Array:
    """Convert (n, 4) shares of the input's width and height to pixels."""
    return np.asarray(boxes * np.array(facts.size * 2, np.float32), np.float32)


def sigmoid(values: Array) -> Array:
    """Return the logistic function of values."""
    return np.asarray(1 / (1 + np.exp(-np.clip(values, -60, 60))), np.float32)


def softmax(values: Array) -> Array:
    """Return the shares along the last axis."""
    powers = np.exp(values - values.max(axis=-1, keepdims=True))
    return np.asarray(powers / powers.sum(axis=-1, keepdims=True), np.float32)


def largest(outputs: Outputs) -> Array:
    """Return the output with two dimensions and the most numbers."""
    return max((each for each in outputs.values() if each.ndim == 2), key=lambda each: each.size)


def named(outputs: Outputs, *words: str) -> Array:
    """Return the output whose name has one of the words, the first word first."""
    for word in words:
        for name, output in outputs.items():
            if word in name.lower():
                return output
    raise KeyError(words)


def objectness(outputs: Outputs, facts: Facts, least: float) -> Candidates:
    """Decode YOLOv5, v6, v7: (n, 5 + classes), each row centre, size, objectness, classes."""
    rows = largest(outputs)
    if rows.shape[0] < rows.shape[1]:
        raise ValueError(
            f"{rows.shape[0]} rows, of which each is a box, of {rows.shape[1]} columns"
        )
    rows = rows[~(rows[:, 4] < least)]
    scores = rows[:, 5:] * rows[:, 4:5]
    if facts.classes:
        scores = scores[:, : facts.classes]
    kept, found, classes = best_classes(scores, least)
    return Candidates(from_centres(rows[kept, :4]), found, classes, scores.shape[1])


def columns(outputs: Outputs, facts: Facts, least: float) -> Candidates:
    """Decode YOLOv8 and v11: (4 + classes, n), each column centre, size, classes.

    More rows than classes are masks or points of the body, which are not used.
    """
    found = largest(outputs)
    if found.shape[0] > found.shape[1]:
        raise ValueError(
            f"{found.shape[0]} rows of {found.shape[1]} columns, of which each is a box"
        )
    scores = found[4 : 4 + facts.classes] if facts.classes else found[4:]
    best = scores.max(axis=0)
    kept = np.flatnonzero(~(best < least))
    classes = scores[:, kept].argmax(axis=0).astype(np.int64)
    return Candidates(from_centres(found[:4, kept].T), best[kept], classes, len(scores))


def finished(outputs: Outputs, _: Facts, least: float) -> Candidates:
    """Decode YOLO with built-in suppression: (n, 6), each row corners, score, class; v10 too.

    YOLOv7 has seven columns, the number of the picture first and the score last. Exports for
    TensorRT have ``num_dets``, ``det_boxes``, ``det_scores`` and ``det_classes``.
    """
    if "num_dets" in outputs:
        count = int(outputs["num_dets"].reshape(-1)[0])
        boxes = outputs["det_boxes"].reshape(-1, 4)[:count]
        scores = outputs["det_scores"].reshape(-1)[:count]
        classes = outputs["det_classes"].reshape(-1)[:count]
    else:
        rows = largest(outputs)
        if rows.shape[1] == 7:
            boxes, classes, scores = rows[:, 1:5], rows[:, 5], rows[:, 6]
        else:
            boxes, scores, classes = rows[:, :4], rows[:, 4], rows[:, 5]
    return Candidates(boxes, scores, whole(classes)).only(~(scores < least))


def grid(outputs: Outputs, facts: Facts, least: float) -> Candidates:
    """Decode YOLOX: (n, 5 + classes), each row relative to its cell, with the logarithm of sizes.

    Source: Z. Ge et al., "YOLOX: exceeding YOLO series in 2021", 2021.
    """
    found = largest(outputs)
    kept = np.flatnonzero(~(found[:, 4] < least))
    corners, strides = _corners(facts.size, STRIDES)
    _check_rows(found, corners)
    rows, corners, strides = found[kept], corners[kept], strides[kept]
    centres = (rows[:, :2] + corners) * strides
    boxes = from_centres(np.concatenate([centres, np.exp(rows[:, 2:4]) * strides], axis=1))
    scores = rows[:, 5:] * rows[:, 4:5]
    kept, best, classes = best_classes(scores, least)
    return Candidates(boxes[kept], best, classes, scores.shape[1])


def distances(outputs: Outputs, facts: Facts, least: float) -> Candidates:
    """Decode NanoDet: (n, classes + 4 bins), each side's distance as the mean over its bins.

    Source: X. Li et al., "Generalized focal loss", 2020. The old exports have three strides and
    centres of cells at half a stride; those of NanoDet-Plus have four, and centres at their corner.
    The oldest, and PicoDet, have two outputs for each stride: scores of classes, and bins.
    """
    grids = heads({name: each.shape for name, each in outputs.items()}, facts.size)
    parts = [np.concatenate([outputs[name] for name in pair], axis=1) for pair in grids]
    found = np.concatenate(parts) if grids else largest(outputs)
    strides: tuple[int, ...] = (*STRIDES, 64)
    middle = 0.5 if grids else 0.0
    if found.shape[0] == cells(facts.size):
        strides, middle = STRIDES, 0.5
    classes = facts.classes or found.shape[1] - 32  # there are 4 x 8 bins in what is published
    if grids:
        classes = outputs[grids[0][0]].shape[1]
    kept, best, numbers = best_classes(found[:, :classes], least)
    corners, sides = _corners(facts.size, strides)
    _check_rows(found, corners)
    centres, sides = (corners[kept] + middle) * sides[kept], sides[kept]
    bins = softmax(found[kept, classes:].reshape(len(kept), 4, -1))
    reach = (bins @ np.arange(bins.shape[2], dtype=np.float32)) * sides
    boxes = np.concatenate([centres - reach[:, :2], centres + reach[:, 2:]], axis=1)
    return Candidates(boxes.astype(np.float32), best, numbers, classes)


def queries(outputs: Outputs, facts: Facts, least: float) -> Candidates:
    """Decode RT-DETR as Ultralytics exports it: (n, 4 + classes), boxes as shares, scores."""
    rows = largest(outputs)
    scores = rows[:, 4:]
    kept, best, classes = best_classes(scores, least)
    boxes = scaled(from_centres(rows[kept, :4]), facts)
    return Candidates(boxes, best, classes, scores.shape[1])


def logits(outputs: Outputs, facts: Facts, least: float) -> Candidates:
    """Decode two outputs, logits of each class and boxes as shares: RT-DETR, D-FINE, RF-DETR."""
    boxes = named(outputs, "boxes", "dets")
    scores = sigmoid(named(outputs, "logits", "labels", "scores"))
    kept, best, classes = best_classes(scores, least)
    found = scaled(from_centres(boxes[kept]), facts)
    return Candidates(found, best, classes, scores.shape[1])


def labelled(outputs: Outputs, _: Facts, least: float) -> Candidates:
    """Decode three outputs, corners in pixels, scores, classes: RT-DETR, D-FINE, torchvision."""
    boxes, scores = named(outputs, "box"), named(outputs, "score").reshape(-1)
    classes = named(outputs, "label", "class").reshape(-1)
    return Candidates(boxes.reshape(-1, 4), scores, whole(classes)).only(~(scores < least))


def shares(outputs: Outputs, facts: Facts, least: float) -> Candidates:
    """Decode SSD: corners as shares of the input.

    TensorFlow's have their classes beside the scores and y before x; the rows of OpenVINO and Caffe
    have 7 columns: picture, class, score, corners. Others have a score for each class, that of the
    background first.
    """
    if len(outputs) == 1:
        rows = next(iter(outputs.values())).reshape(-1, 7)
        rows = rows[rows[:, 0] >= 0]  # the first without an object ends them
        found = Candidates(scaled(rows[:, 3:7], facts), rows[:, 2], whole(rows[:, 1]))
        return found.only(~(found.scores < least))
    boxes = named(outputs, "box").reshape(-1, 4)
    scores = named(outputs, "score")
    if any("detection" in name for name in outputs):
        boxes = boxes[:, [1, 0, 3, 2]]
    if scores.ndim == 2 and scores.shape[1] > 1:
        kept, best, classes = best_classes(scores[:, 1:], least)
        return Candidates(scaled(boxes[kept], facts), best, classes + 1, scores.shape[1])
    scores, labels = scores.reshape(-1), named(outputs, "class", "label").reshape(-1)
    return Candidates(scaled(boxes, facts), scores, whole(labels)).only(~(scores < least))


def whole(classes: Array) -> NDArray[np.int64]:
    """Return numbers of classes as integers; those that are none become -1."""
    known = np.isfinite(classes) & (np.abs(classes) < 1e6)
    return np.where(known, classes, -1).astype(np.int64)


def _check_rows(found: Array, corners: Array) -> None:
    """Check that there is one row for each cell.

    Raises:
        ValueError: There are more or fewer.
    """
    if len(found) != len(corners):
        raise ValueError(f"{len(found)} rows for {len(corners)} cells")


def _corners(size: tuple[int, int], strides: tuple[int, ...]) -> tuple[Array, Array]:
    """Return column and row of each cell of all grids, (n, 2), and its stride, (n, 1)."""
    corners, sides = [], []
    for stride in strides:
        across, down = -(-size[0] // stride), -(-size[1] // stride)
        rows, places = np.mgrid[:down, :across]
        corners.append(np.stack([places, rows], axis=2).reshape(-1, 2))
        sides.append(np.full((across * down, 1), stride))
    return np.concatenate(corners).astype(np.float32), np.concatenate(sides).astype(np.float32)
