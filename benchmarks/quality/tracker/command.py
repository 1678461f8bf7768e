"""``python -m benchmarks.quality tracker``: prints tables in Markdown, writes pictures."""

from __future__ import annotations

import argparse
import datetime
import itertools
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import astuple
from pathlib import Path

import cv2
import numpy as np

from benchmarks.quality.data import found
from benchmarks.quality.tracker import (
    ablation,
    belt,
    boxes,
    clips,
    counting,
    degradation,
    drawing,
    scenarios,
    wire,
)
from benchmarks.quality.tracker.comparison import METHODS, Comparison, compare
from benchmarks.quality.tracker.room import Room
from benchmarks.quality.tracker.scoring import Score, check_the_scores
from benchmarks.quality.tracker.sequence import (
    Shots,
    as_jpeg,
    begun_at,
    dropped,
    every,
    read_mot,
    video,
)
from tests.support.pictures.belt import Belt
from zenoh_vision.host.parallel import workers

VIDEO, TRUTH = "vtest.avi", "pets_s2l1_gt_first265.txt"
LATER_FROM = 179
EARLIER, LATER = f"1 to {LATER_FROM}", f"{LATER_FROM + 1} to 265"
"""The parts of vtest. Constants are chosen by the earlier frames, but the later ones' scores were
seen, and some rules chosen with them: no part is untouched.
"""

LATE_STARTS = (20, 40, 60, 80, 100, 120)
DROPPED = 0.3
DROP_SEEDS = (1, 2, 3)
ROOM_SEEDS = range(1, 13)
STEP_OF_5_HZ = 6


def main(words: Sequence[str]) -> None:
    """Measure what was asked for, and print a table for each part."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.quality tracker", description=__doc__
    )
    parser.add_argument(
        "--out", type=Path, default=Path("build/quality"), help="folder of the pictures"
    )
    parser.add_argument(
        "--only", nargs="+", choices=PARTS, default=PARTS, help="parts to measure; default all"
    )
    parser.add_argument(
        "--scene",
        choices=[make.__name__ for make in scenarios.SCENARIOS],
        help="measure this scene alone",
    )
    parser.add_argument(
        "--ablate",
        action="store_true",
        help="measure the clips without each rule, and with each constant halved and doubled: "
        "a quarter of an hour on 2 cores",
    )
    parser.add_argument("--draw-every", type=int, default=20, help="pictures between drawn ones")
    options = parser.parse_args(words)
    cv2.setNumThreads(1)
    workers.limit(1)
    if options.ablate:
        measure_ablations()
        return
    check_the_scores()
    today = datetime.datetime.now(datetime.UTC).date()
    print(f"# {today}, {platform.machine()}, OpenCV {cv2.__version__}, NumPy {np.__version__}")
    for part in PARTS:
        if part in options.only:
            begun_s = time.monotonic()
            MEASUREMENTS[part](options)
            print(f"# {part}: {time.monotonic() - begun_s:.0f} s", flush=True)


def measure_clips(_: argparse.Namespace) -> None:
    """Measure the real clips with all methods."""
    found_clips = list(clips.clips())
    if not found_clips:
        print("# not measured: no clips; set ZV_TEST_DATA")
        return
    title("clip", "method", "MOTA", "IDF1", "P", "R", "switches", "false a frame", "ms")
    scores: dict[str, dict[str, Score]] = {name: {} for name in clips.METHODS}
    for clip in found_clips:
        for name, make in clips.METHODS.items():
            score, false, spent_ms = clips.measure(clip, make())
            scores[name][clip.name] = score
            figures = [score.mota, score.idf1, score.precision, score.recall]
            row(
                clip.name,
                name,
                *(f"{each:.1f}" for each in figures),
                f"{score.switches}",
                f"{false:.2f}",
                f"{spent_ms:.1f}",
            )
    for name, each in scores.items():
        row("mean", name, *(f"{value:.1f}" for value in clips.means(each)), *[""] * 5)


def measure_degraded(_: argparse.Namespace) -> None:
    """Measure the product on the clips as worse cameras would have recorded them."""
    scores: dict[str, dict[str, Score]] = {}
    false: dict[str, list[float]] = {}
    for clip in clips.clips():
        for way, changed in degradation.degraded(clip):
            score, boxes_a_frame, _ = clips.measure(changed, clips.Robust())
            scores.setdefault(way, {})[clip.name] = score
            false.setdefault(way, []).append(boxes_a_frame)
    if not scores:
        print("# not measured: no clips; set ZV_TEST_DATA")
        return
    title("", "MOTA", "IDF1", "false a frame", *next(iter(scores.values())))
    for way, each in scores.items():
        mota, idf1 = ablation.means(each)
        figures = f"{mota:.1f}", f"{idf1:.1f}", f"{np.mean(false[way]):.2f}"
        row(way, *figures, *map(in_short, each.values()))


def in_short(score: Score) -> str:
    """Return the scores of a clip; the number of false boxes of one without objects."""
    if not score.boxes:
        return f"{score.false_boxes} false"
    return f"{score.mota:.0f} / {score.idf1:.0f}"


def measure_ablations() -> None:
    """Measure the clips without each rule, with other constants, and leaving clips out."""
    found = {}
    for name, scores in ablation.results():
        if not found:
            title("", "MOTA", "IDF1", "gain", *scores)
        found[name] = scores
        mota, idf1 = ablation.means(scores)
        usual = ablation.means(found[ablation.AS_IT_IS])
        gain = f"{mota - usual[0]:+.1f} / {idf1 - usual[1]:+.1f}"
        row(name, f"{mota:.1f}", f"{idf1:.1f}", gain, *map(in_short, scores.values()))
    title("clip left out", "what the others choose", "MOTA", "IDF1")
    rows = []
    for name in sorted({each.partition(",")[0] for each in found[ablation.AS_IT_IS]}):
        choice = ablation.chosen(found, name)
        scores = {
            clip: score
            for clip, score in found[choice].items()
            if clip.partition(",")[0] == name and score.boxes
        }
        if scores:
            rows.append(ablation.means(scores))
            row(name, choice, *(f"{value:.1f}" for value in rows[-1]))
    row("mean", "", *(f"{value:.1f}" for value in np.mean(rows, axis=0)))


def measure_vtest(options: argparse.Namespace) -> None:
    """Measure the real video with all methods, and draw frames."""
    files = found(VIDEO, TRUTH)
    if files is None:
        return
    shots = video(files[0], read_mot(files[1]))
    comparison = compare(shots)
    title("vtest.avi", "part", *HEADINGS)
    for name in METHODS:
        scorer = comparison.scorers[name]
        row(name, "all", *cells(scorer.score(), tracks=name != "tutorial"))
        row("", EARLIER, *cells(scorer.score(end=LATER_FROM), tracks=name != "tutorial"))
        row("", LATER, *cells(scorer.score(first=LATER_FROM), tracks=name != "tutorial"))
    draw(options, "vtest", shots, comparison)


def measure_variants(_: argparse.Namespace) -> None:
    """Measure the real video at other rates, with losses, as JPEG, and begun later."""
    files = found(VIDEO, TRUTH)
    if files is None:
        return
    shots = video(files[0], read_mot(files[1]))
    variants: dict[str, Shots] = {
        "10 Hz": shots,
        "5 Hz": every(shots, 2),
        "5 Hz, the other frames": every(shots, 2, first=1),
        f"{DROPPED:.0%} dropped": dropped(shots, DROPPED),
        f"{DROPPED:.0%} dropped, others": dropped(shots, DROPPED, seed=2),
        "JPEG quality 80": as_jpeg(shots, 80),
        **{f"begun at frame {first}": begun_at(shots, first) for first in LATE_STARTS},
    }
    title("vtest.avi, robust", *(f"{part}: {SHORT}" for part in ("all", EARLIER, LATER)))
    figures = []
    for name, variant in variants.items():
        scorer = compare(variant, tutorial=False).scorers["robust"]
        parts = [scorer.score(0, None), scorer.score(0, LATER_FROM), scorer.score(LATER_FROM)]
        row(name, *(short(score, True) for score in parts))
        figures.append([(each.mota, each.idf1, each.switches, each.fit) for each in parts])
    means = np.mean(figures, axis=0)
    row("mean", *(f"{a:.1f} / {b:.1f} / {c:.1f} / {d:.1f} %" for a, b, c, d in means))


def measure_scenes(options: argparse.Namespace) -> None:
    """Measure the synthetic scenes at several rates and with losses; the tutorial at 10 Hz only.

    All rates are scored at the same instants, see ``mean_at_5_hz``.
    """
    title("scene", "frames", *(f"{name}: {SHORT}" for name in METHODS))
    for make in scenarios.SCENARIOS:
        if options.scene not in (None, make.__name__):
            continue
        scene = make()
        for name, variants in rates(list(scene.shots(30.0)()).__iter__).items():
            compared = [compare(shots, tutorial=name == "10 Hz") for shots in variants]
            texts = [
                short(mean_at_5_hz(compared, method), method != "tutorial") for method in METHODS
            ]
            texts[0] = texts[0] if name == "10 Hz" else "-"
            row(scene.name, name, *texts)
            draw(options, f"{make.__name__}_{name.replace(' ', '_')}", variants[0], compared[0])


def rates(shots: Shots) -> dict[str, list[Shots]]:
    """Return a sequence of 30 Hz, each third and sixth frame of it, and it with random losses.

    So all rates show the same pictures. For the losses there is a sequence for each seed.
    """
    return {
        "30 Hz": [shots],
        "10 Hz": [every(shots, 3)],
        "5 Hz": [every(shots, STEP_OF_5_HZ)],
        f"30 Hz, {DROPPED:.0%} dropped": [dropped(shots, DROPPED, seed) for seed in DROP_SEEDS],
    }


def mean_at_5_hz(compared: Sequence[Comparison], method: str) -> Score:
    """Return the mean scores of a method in sequences of 30 Hz, at the frames of 5 Hz alone.

    So all rates are scored at the same instants: a change of the id is one error at any rate, and
    would weigh less where there are more frames, and the time until a track is confirmed would
    weigh differently.
    """
    scores = [each.scorers[method].at_each(STEP_OF_5_HZ).score() for each in compared]
    return Score(*np.mean([astuple(score) for score in scores], axis=0).tolist())


def measure_rooms(_: argparse.Namespace) -> None:
    """Measure several rooms."""
    title("room, robust", "MOTA", "deviation of seeds", "missed", "false", "switches")
    figures: dict[str, list[list[float]]] = {}
    for seed in ROOM_SEEDS:
        kept = list(Room(seed=seed).shots(30.0)())  # 0.8 GB, since drawing takes as long
        for name, variants in rates(kept.__iter__).items():
            score = mean_at_5_hz([compare(shots, tutorial=False) for shots in variants], "robust")
            errors = (score.misses, score.false_boxes, score.switches)
            shares = [100 * count / score.boxes for count in errors]
            figures.setdefault(name, []).append([score.mota, *shares])
    for name, rows in figures.items():
        mota, *means = np.mean(rows, axis=0)
        deviation = np.std([each[0] for each in rows])
        row(name, f"{mota:.1f}", f"{deviation:.1f}", *(f"{share:.1f} %" for share in means))


def measure_belt(options: argparse.Namespace) -> None:
    """Measure how often each object on the belt is counted, and the scores of its tracks."""
    title("belt", "method", "counted once", "touching", "missed", "extra", "time error", *HEADINGS)
    runs = (("30 Hz", 30.0, 0.0), ("10 Hz", 10.0, 0.0), ("30 Hz, 30 % dropped", 30.0, 0.3))
    for (name, rate_hz, share), convex in itertools.product(runs, (False, True)):
        made = Belt(rate_hz=rate_hz)
        shots = dropped(belt.shots_of(made), share) if share else belt.shots_of(made)
        comparison = compare(shots, tutorial=False, convex=convex)
        for method in METHODS[1:]:
            counted = belt.counts(made, belt.crossings_of(made, centres(comparison, method, made)))
            row(
                name + ", convex" * convex,
                method,
                f"{counted.once} of {counted.objects}",
                f"{counted.pairs_once} of {counted.in_pairs}",
                f"{counted.missed}",
                f"{counted.extra}",
                f"{counted.error_ms:.0f} ms",
                *cells(comparison.scorers[method].score()),
            )
        if rate_hz == 30 and not share:
            draw(options, "belt_convex" if convex else "belt", shots, comparison)


def centres(
    comparison: Comparison, method: str, made: Belt
) -> dict[int, list[tuple[float, float, float]]]:
    """Return time, x and y in pixels of each track's centre, frame by frame."""
    paths: dict[int, list[tuple[float, float, float]]] = {}
    for index, result in comparison.results.items():
        for identity, (x, y, width, height) in result.found[method].boxes.items():
            place = (made.time_s(index), x + (width - 1) / 2, y + (height - 1) / 2)
            paths.setdefault(identity, []).append(place)
    return paths


def measure_counts(_: argparse.Namespace) -> None:
    """Measure how often the events on the real belt count right, at several rates."""
    clip = next((each for each in clips.clips() if each.name == "belt"), None)
    if clip is None:
        print("# not measured: no clip belt; set ZV_TEST_DATA")
        return
    true = counting.true_counts(clip)
    title("belt, line in the middle", "lost", "right", "wrong counts")
    for step, lost in itertools.product(counting.STEPS, (0.0, counting.LOST)):
        seeds = range(counting.RUNS if lost else step)  # without losses, others are the same
        found = [counting.counted(clip, step, lost, seed) for seed in seeds]
        wrong = [f"{each['left']} left, {each['right']} right" for each in found if each != true]
        row(
            f"{clip.rate_hz / step:.0f} Hz",
            f"{lost:.0%}",
            f"{len(found) - len(wrong)} of {len(found)}",
            "; ".join(wrong),
        )


def measure_wire(_: argparse.Namespace) -> None:
    """Measure what arrives from the services."""
    files = found(VIDEO, TRUTH)
    if files is None:
        return
    truth = read_mot(files[1])
    scorer, processed = wire.over_the_wire(files[0], truth)
    title("zv camera into zv tracker, 10 Hz", "part", *HEADINGS)
    row(f"{processed} of {max(truth) + 1} frames processed", "all", *cells(scorer.score()))
    row("", EARLIER, *cells(scorer.score(end=LATER_FROM)))
    row("", LATER, *cells(scorer.score(first=LATER_FROM)))


def measure_boxes(_: argparse.Namespace) -> None:
    """Measure the association of a model's boxes beside SORT and ByteTrack."""
    title("model", "sequence", *(f"{name}: MOTA / IDF1 / switches" for name in boxes.METHODS))
    sequences = list(boxes.labels())
    for name, faults in boxes.FAULTS.items():
        means: dict[str, list[list[float]]] = {method: [] for method in boxes.METHODS}
        for labels in sequences:
            texts = []
            for method, make in boxes.METHODS.items():
                score = boxes.measure(labels, faults, make)
                means[method].append([score.mota, score.idf1, score.switches])
                texts.append(f"{score.mota:.1f} / {score.idf1:.1f} / {score.switches:.1f}")
            row(name, labels.name, *texts)
        mean = [np.mean(rows, axis=0) for rows in means.values()]
        row(name, "mean", *(f"{mota:.1f} / {idf1:.1f} / {sw:.1f}" for mota, idf1, sw in mean))


MEASUREMENTS: dict[str, Callable[[argparse.Namespace], None]] = {
    "clips": measure_clips,
    "degraded": measure_degraded,
    "boxes": measure_boxes,
    "vtest": measure_vtest,
    "variants": measure_variants,
    "scenes": measure_scenes,
    "rooms": measure_rooms,
    "belt": measure_belt,
    "counts": measure_counts,
    "wire": measure_wire,
}
PARTS = tuple(MEASUREMENTS)

SHORT = "MOTA / IDF1 / switches / fit"
HEADINGS = ("MOTA", "IDF1", "switches", "missed", "false", "fit")


def cells(score: Score, *, tracks: bool = True) -> list[str]:
    """Return the cells under ``HEADINGS``."""
    counts = [score.switches, score.misses, score.false_boxes]
    ids = [f"{score.mota:.1f}", f"{score.idf1:.1f}", *(f"{count}" for count in counts)]
    return [*(ids if tracks else ["-"] * len(ids)), f"{score.fit:.1f} %"]


def short(score: Score, tracks: bool) -> str:
    """Return a score in one cell."""
    ids = f"{score.mota:.1f} / {score.idf1:.1f} / {score.switches:.3g} / " if tracks else ""
    return f"{ids}{score.fit:.1f} %"


def title(*names: str) -> None:
    """Begin a table."""
    print()
    row(*names)
    print("|---" * len(names) + "|", flush=True)


def row(*texts: str) -> None:
    """Print a row of a table."""
    print(f"| {' | '.join(texts)} |", flush=True)


def draw(options: argparse.Namespace, name: str, shots: Shots, comparison: Comparison) -> None:
    """Write pictures of a sequence, and its errors, into a folder of its own."""
    indices = drawing.indices_to_draw(comparison, options.draw_every)
    drawing.write_pictures(options.out / name, shots, comparison, indices)
