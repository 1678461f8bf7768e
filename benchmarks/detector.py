"""Measures what the pipeline ``detector`` adds to a bare model, and what an empty scene costs."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.stream import percentiles
from tests.support import detector_models
from zenoh_vision.host.allocator import keep_freed_memory

SIZE = (768, 576)
INPUT = 640
RATE_HZ = 10.0
WARM_UP = 20

Pixels = NDArray[np.uint8]


def overhead(seconds: float) -> dict[str, Any]:
    """Return the time of a frame by the pipeline beside that of its model alone.

    The model is the tests' own with an input of 640x640 and 8400 candidates, as YOLO11n has. Frames
    are pixels of 768x576 with three moving objects. ``bare`` is what the shortest program does: fit
    the frame into the input by OpenCV, convert it by ``blobFromImage``, run the model, ignore its
    outputs. ``run`` is the run alone. They take each frame in turn.
    """
    from zv.tracker.detector.class_names import Wanted
    from zv.tracker.detector.model import Model, ModelOptions
    from zv.tracker.pipelines.detector import DetectorParameters, DetectorTracker

    with tempfile.TemporaryDirectory() as folder:
        path = detector_models.save(Path(folder) / "tiny.onnx", "yolov8", size=INPUT)
        model = Model(ModelOptions(str(path), threads=1))
    tracker = DetectorTracker(DetectorParameters(Wanted(0.5)))
    spent: dict[str, list[float]] = {"run": [], "bare": [], "pipeline": []}
    end_s = time.monotonic() + seconds
    for index in range(10_000):
        bgr = _frame(index)
        ready = {"images": _blob(bgr)}

        def bare(bgr: Pixels = bgr) -> None:
            model.runtime.run({"images": _blob(bgr)})

        def pipeline(bgr: Pixels = bgr, index: int = index) -> None:
            tracker.begin(round(index * 1e9 / RATE_HZ), index, SIZE, None)
            picture = model.prepared(SIZE, lambda *_: bgr)
            tracker.finish(model.detect([picture], 0.1, 0.6)[0].detections)

        timed(spent["run"], lambda ready=ready: model.runtime.run(ready))
        for name, call in (("bare", bare), ("pipeline", pipeline))[:: 1 if index % 2 else -1]:
            timed(spent[name], call)
        if time.monotonic() > end_s and index > 2 * WARM_UP:
            break
    median = {name: float(np.median(times[WARM_UP:])) for name, times in spent.items()}
    return {
        "frames": len(spent["bare"]) - WARM_UP,
        "tracks": len(tracker.tracks),
        "ms": {name: round(value, 3) for name, value in median.items()},
        "overhead_ms": round(median["pipeline"] - median["bare"], 3),
    }


def _blob(bgr: Pixels) -> NDArray[Any]:
    width, height = SIZE
    scale = INPUT / max(SIZE)
    fitted = cv2.resize(bgr, (round(width * scale), round(height * scale)))
    margin = INPUT - fitted.shape[0]
    above = margin // 2
    fitted = cv2.copyMakeBorder(
        fitted, above, margin - above, 0, 0, cv2.BORDER_CONSTANT, value=(114, 114, 114)
    )
    return np.asarray(cv2.dnn.blobFromImage(fitted, 1 / 255, swapRB=True))


def empty_scene(seconds: float) -> dict[str, Any]:
    """Return the time of an empty frame with ``on_motion`` beside that of motion alone."""
    from zv.tracker.detector.class_names import Wanted
    from zv.tracker.pipelines.base import working_scale
    from zv.tracker.pipelines.detector import DetectorParameters, DetectorTracker
    from zv.tracker.pipelines.robust import RobustTracker

    keep_freed_memory()
    rng = np.random.default_rng(1)
    scale = working_scale(*SIZE)
    room = np.full((-(-SIZE[1] // scale), -(-SIZE[0] // scale), 3), 90, np.uint8)
    room[40:90, 60:160], room[150:220, 200:300] = 160, 40
    robust, tracker = RobustTracker(), DetectorTracker(DetectorParameters(Wanted(0.5), 1, True))
    spent: dict[str, list[float]] = {"robust": [], "on_motion": []}
    wanted = 0
    end_s = time.monotonic() + seconds
    for index in range(10_000):
        noise = rng.normal(0, 2, room.shape)
        picture = np.clip(room + noise, 0, 255).astype(np.uint8)
        stamp_ns = round(index * 1e9 / RATE_HZ)

        def detector(picture: Pixels = picture, index: int = index, at: int = stamp_ns) -> None:
            nonlocal wanted
            runs = tracker.begin(at, index, SIZE, picture)
            tracker.finish([] if runs else None)
            wanted += runs and index >= WARM_UP

        runs = {
            "robust": lambda picture=picture, at=stamp_ns: robust.update(picture, at, SIZE),
            "on_motion": detector,
        }
        for name in list(runs)[:: 1 if index % 2 else -1]:
            timed(spent[name], runs[name])
        if time.monotonic() > end_s and index > 2 * WARM_UP:
            break
    median = {name: float(np.median(times[WARM_UP:])) for name, times in spent.items()}
    return {
        "frames": len(spent["robust"]) - WARM_UP,
        "frames_for_the_model": wanted,
        "ms_p50_p99": {name: percentiles(times[WARM_UP:]) for name, times in spent.items()},
        "ratio": round(median["on_motion"] / median["robust"], 3),
    }


def timed(spent: list[float], call: Callable[[], object]) -> None:
    """Add the CPU time of a call on this thread, ms."""
    begun_s = time.thread_time()
    call()
    spent.append(1e3 * (time.thread_time() - begun_s))


def _frame(index: int) -> Pixels:
    step = 4 * (index % 100)
    boxes = {
        0: (20 + step, 60, 80 + step, 200),
        1: (700 - step, 250, 760 - step, 400),
        2: (300, 100 + step // 2, 380, 160 + step // 2),
    }
    return detector_models.scene(boxes, SIZE)
