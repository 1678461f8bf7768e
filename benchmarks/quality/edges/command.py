"""``python -m benchmarks.quality edges``: scores, flicker and speed of every detector in one run.

    python -m benchmarks.quality edges --detectors colour "cv2.Canny, blur 2" --images 10

The images are those of BSDS500's training set that are held back. The weights of ``learned`` were
trained on them too, so ``learned, 160`` is scored, the same network trained on the other 160. An
image takes about 4 seconds for each detector, all 40 half an hour of one core for all of them.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

import cv2
import numpy as np

from benchmarks.quality.data import found
from benchmarks.quality.edges import flicker, images, scoring
from zenoh_vision.host.parallel import workers
from zv.edge.detectors.available import DETECTORS
from zv.edge.detectors.canny import Canny
from zv.edge.detectors.detection import Detector
from zv.edge.detectors.learned import EdgeNetwork, Learned

BARE: dict[str, Callable[[], Detector]] = {
    "cv2.Canny": partial(Canny, sigma=0.0),
    "cv2.Canny, blur 2": partial(Canny, sigma=2.0),
}
"""The bare calls of OpenCV for comparison; the strength before their thresholds is scored."""


@dataclass(frozen=True, slots=True)
class Learned160(Learned):
    """``learned`` with weights that were not trained on the images that are held back."""

    network: ClassVar = EdgeNetwork(Path(__file__).with_name("learned_160.onnx"))


CHOICES: dict[str, Callable[[], Detector]] = {**BARE, **DETECTORS, "learned, 160": Learned160}
NOT_SCORED = "learned"
TIMED_SIZE = (640, 480)
TIMED_RUNS = 40


def strengths_of(detector: Detector, folder: Path, names: Sequence[str]) -> list[np.ndarray]:
    """Return the thinned strengths of each image."""
    pictures = [images.read(folder, name).picture for name in names]
    return [
        detector.detect(flicker.in_its_form(detector, picture)).strength for picture in pictures
    ]


def thresholds_by_density(detector: Detector, folder: Path) -> list[float]:
    """Return the thresholds at which 0, 1, ... 10 percent of the training pixels are edges."""
    strengths = strengths_of(detector, folder, images.image_names(folder, held_back=False))
    pixels = sum(each.size for each in strengths)
    falling = np.sort(np.concatenate([each[each > 0] for each in strengths]))[::-1]
    ranks = [min(pixels * percent // 100, falling.size - 1) for percent in range(1, 11)]
    return [detector.full_scale, *(round(float(falling[rank]), 3) for rank in ranks)]


def counted(folder: Path, job: tuple[str, np.ndarray, np.ndarray]) -> scoring.Counts:
    """Match one image's strengths."""
    name, strength, thresholds = job
    return scoring.count(strength, images.read(folder, name).boundaries, thresholds)


def milliseconds(detector: Detector, picture: np.ndarray) -> float:
    """Return the median time of one edge map of 640 x 480 pixels on one core."""
    resized = np.asarray(cv2.resize(picture, TIMED_SIZE), np.uint8)
    frame = flicker.in_its_form(detector, resized)
    times = []
    for _ in range(TIMED_RUNS):
        begin = time.perf_counter()
        _ = detector.detect(frame).edges
        times.append(time.perf_counter() - begin)
    return float(np.median(times)) * 1000


def main(words: Sequence[str]) -> None:
    """Measure and print one line for each detector."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.quality edges", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--images", type=int, default=4, help="of the 40 held back")
    parser.add_argument("--detectors", nargs="+", choices=CHOICES, default=list(CHOICES))
    parser.add_argument("--jobs", type=int, default=1, help="processes that match pixels")
    parser.add_argument(
        "--thresholds",
        action="store_true",
        help="print instead those of 0 to 10 percent of the pixels",
    )
    options = parser.parse_args(words)
    cv2.setNumThreads(1)
    workers.limit(1)
    bsds, vtest = found(images.FOLDER), found("vtest.avi")
    if bsds is not None and options.thresholds:
        for name in options.detectors:
            print(name, thresholds_by_density(CHOICES[name](), bsds[0]), flush=True)
        return
    names: list[str] = []
    if bsds is not None:
        held_back = images.image_names(bsds[0], held_back=True)
        names = held_back[:: max(1, len(held_back) // options.images)][: options.images]
        print(f"# {len(names)} images of BSDS500's training set that are held back", flush=True)
    columns = ("ODS", "OIS", "AP", "threshold", "still", "density", "vtest", "density", "ms")
    print(f"{'':24}" + "".join(f"{each:>10}" for each in columns), flush=True)
    with ProcessPoolExecutor(options.jobs) as pool:
        for name in options.detectors:
            detector = CHOICES[name]()
            cells = [""] * 4
            if bsds is not None and name != NOT_SCORED:
                strengths = strengths_of(detector, bsds[0], names)
                thresholds = scoring.thresholds_of(strengths)
                jobs = [(*each, thresholds) for each in zip(names, strengths, strict=True)]
                counts = list(pool.map(partial(counted, bsds[0]), jobs))
                scores = scoring.scores_of(counts, thresholds)
                found_scores = (scores.ods, scores.ois, scores.ap, scores.threshold)
                cells = [f"{value:.3f}" for value in found_scores]
            for scene in (flicker.still_scene(), flicker.video(vtest[0]) if vtest else None):
                shares = flicker.flicker(detector, scene) if scene else None
                cells += [f"{share:.1%}" for share in shares] if shares else ["", ""]
            picture = next(flicker.still_scene())
            cells.append(f"{milliseconds(detector, picture):.2f}")
            print(f"{name:24}" + "".join(f"{cell:>10}" for cell in cells), flush=True)
