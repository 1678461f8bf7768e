"""Runs the systems in turn, three times, over sizes and qualities; collects what they measured."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.video.frame import VideoFrame
from av.video.stream import VideoStream
from numpy.typing import NDArray

from benchmarks import floor
from benchmarks.material import frames as material
from benchmarks.peers.contest import Failed, Outcome
from benchmarks.peers.programs.measuring import RATE_HZ, WARM_UP
from benchmarks.peers.systems import System, systems
from zenoh_vision.errors import VisionError

SIZES = ((768, 576), (1920, 1080))
QUALITIES = (80, 95)
ROUNDS = 3
"""The speed of a virtual machine changes by up to half within minutes, so one more round is better
than longer rounds."""
SHARE = 4 / 15
"""Of the seconds of other measurements, for each system in each round: 14 minutes in all."""

BITS_PER_PIXEL = 4

SPARE_S = 15.0
"""The clip is longer than a run by this, for the start of the programs and a tracker's warm-up: at
its end a file is opened again, which a camera is not, and our tracker begins anew."""

FLOOR = System("encoding and decoding alone", lambda *_: Outcome((), 0.0, 0.0, 0.0))


@dataclass(slots=True)
class Row:
    """All rounds of one system at one size and quality; ``quality`` is None without a JPEG."""

    system: System
    size: tuple[int, int]
    quality: int | None
    outcomes: list[Outcome] = field(default_factory=list)
    failed: str = ""

    @property
    def p50_ms(self) -> float:
        """Median age of the frames of all rounds."""
        return self._percentile(50)

    @property
    def p99_ms(self) -> float:
        """99th percentile of the ages of all rounds."""
        return self._percentile(99)

    @property
    def cpu_ms(self) -> float:
        """CPU time of camera and consumer for a frame, mean of the rounds."""
        return float(np.mean([each.cpu_ms for each in self.outcomes]))

    @property
    def between_ms(self) -> float:
        """CPU time of the router or master for a frame, mean of the rounds."""
        return float(np.mean([each.between_ms for each in self.outcomes]))

    @property
    def memory_mb(self) -> float:
        """Memory of all processes, mean of the rounds."""
        return float(np.mean([each.memory_mb for each in self.outcomes]))

    def _percentile(self, percent: float) -> float:
        return float(
            np.percentile([age for each in self.outcomes for age in each.ages_ms], percent)
        )


def write_clip(path: Path, pictures: Sequence[NDArray[np.uint8]], seconds: float) -> None:
    """Write pictures, forth and back, as a video of 30 Hz that lasts at least so many seconds."""
    height, width = pictures[0].shape[:2]
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=int(RATE_HZ))
        assert isinstance(stream, VideoStream)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.bit_rate = int(width * height * RATE_HZ * BITS_PER_PIXEL)
        once = [*pictures, *pictures[-2:0:-1]]
        passes = math.ceil(seconds * RATE_HZ / len(once))
        for number, pixels in enumerate(once * passes):
            frame = VideoFrame.from_ndarray(pixels, format="bgr24")
            frame.pts, frame.time_base = number, Fraction(1, int(RATE_HZ))
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def compare(seconds: float) -> list[Row]:
    """Measure every system for so many seconds in each round.

    Those that are missing, or fail, are left out after a line that says why.
    """
    present = []
    for system in systems():
        missing = system.missing()
        if missing:
            print(f"# {system.name}: not measured: {missing}", flush=True)
        else:
            present.append(system)
    rows = [
        Row(system, size, quality)
        for size in SIZES
        for system in (FLOOR, *present)
        for quality in (QUALITIES if system.jpeg else (None,))
    ]
    with tempfile.TemporaryDirectory() as folder:
        clips, pictures = {}, {}
        for size in SIZES:
            clips[size] = Path(folder) / f"{size[0]}x{size[1]}.mp4"
            pictures[size] = material(*size)
            write_clip(clips[size], pictures[size], WARM_UP / RATE_HZ + seconds + SPARE_S)
        for number in range(ROUNDS):
            begun_s = time.monotonic()
            for row in rows:
                _run(row, clips[row.size], pictures[row.size], seconds)
            took_s = time.monotonic() - begun_s
            print(f"# round {number + 1} of {ROUNDS}: {took_s:.0f} s", flush=True)
    for row in rows:
        if row.failed:
            print(f"# {row.system.name}: left out: {row.failed}", flush=True)
    return [row for row in rows if row.outcomes and not row.failed]


def _run(row: Row, clip: Path, pictures: list[NDArray[np.uint8]], seconds: float) -> None:
    if row.failed:
        return
    quality = row.quality or QUALITIES[0]
    if row.system is FLOOR:
        found = floor.measure(pictures, RATE_HZ, seconds, quality)
        row.outcomes.append(Outcome(found.ages_ms, found.cpu_ms, 0.0, 0.0))
        return
    try:
        row.outcomes.append(row.system.run(clip, quality, int(seconds * RATE_HZ)))
    except (Failed, VisionError) as error:
        row.failed = str(error)
