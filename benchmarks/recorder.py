"""What recording costs: CPU time beside that of ``cp``, losses, and the age of frames elsewhere."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack
import zenoh

from benchmarks.material import frames
from benchmarks.system import System
from zenoh_vision.image.codecs import encode_jpeg
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.session import direct, open_session
from zv.bag.record import Record
from zv.bag.recording import Recording
from zv.bag.report import report_of
from zv.bag.writer import Writer

CAMERAS = ("one", "two", "three", "four")
WIDTH, HEIGHT, RATE_HZ, QUALITY = 1920, 1080, 30.0, 80
LARGE_BYTES = 10 * 10**9
CHUNK_BYTES = 4 << 20
TRACKS, CONTOURS = 10, 60


def recording(seconds: float) -> dict[str, Any]:
    """Record four cameras with tracks and contours beside them."""
    with tempfile.TemporaryDirectory(dir=os.environ.get("ZV_BENCH_FOLDER")) as folder:
        path = Path(folder) / "run.mcap"
        alone = _run(seconds, None)
        beside = _run(seconds, path)
        with Recording(path) as opened:
            report = report_of(opened)
        size_mb = report.size / 1e6
        return {
            "MB_per_s": round(size_mb / (report.end_ns - report.start_ns) * 1e9, 1),
            "messages": sum(each.count for each in report.keys),
            "missed": report.missed,
            "verdict": report.verdict,
            "recorder_cores": round(beside["cores"], 3),
            "recorder_cpu_ms_per_MB": round(beside["cores"] * seconds * 1e3 / size_mb, 2),
            "cp_cpu_ms_per_MB": round(_copying_s(path) * 1e3 / size_mb, 2),
            "age_ms_alone": alone["age_ms"],
            "age_ms_beside_recorder": beside["age_ms"],
        }


def _run(seconds: float, path: Path | None) -> dict[str, Any]:
    """Measure the age of one camera's frames at a consumer, with or without a recorder."""
    ages: list[float] = []

    def note(sample: zenoh.Sample) -> None:
        assert sample.attachment is not None
        stamp_ns = msgpack.unpackb(sample.attachment.to_bytes())["stamp_ns"]
        ages.append((time.time_ns() - stamp_ns) / 1e6)

    with System() as system:
        session = system.session()
        session.declare_subscriber("vision/one/image/compressed", direct(note))
        if path is not None:
            command = ("bag", "record", "vision/**", "-o", str(path))
            system.start("recorder", "-m", "zv", *command, "--connect", system.endpoint)
        system.start("cameras", "-m", "benchmarks.recorder", system.endpoint)
        _wait(lambda: ages)
        time.sleep(2.0)
        system.begin()
        ages.clear()
        time.sleep(seconds)
        cores = system.cpu_s().get("recorder", 0.0) / seconds
        measured = sorted(ages)
        if path is not None:
            process = system.processes.pop("recorder")
            process.terminate()
            process.wait(20)
        session.close()
    p50, p99 = (measured[int(len(measured) * share)] for share in (0.5, 0.99))
    return {"cores": cores, "age_ms": {"p50": round(p50, 2), "p99": round(p99, 2)}}


def _wait(until: Callable[[], object]) -> None:
    end_s = time.monotonic() + 60
    while not until():
        if time.monotonic() > end_s:
            raise SystemExit("nothing arrived within 60 s")
        time.sleep(0.05)


def _copying_s(path: Path) -> float:
    """Return the CPU time of ``cp``, seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(["cp", path, path.with_suffix(".copy")], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


class _Sparse(Writer):
    """Leaves holes in a file instead of zeros, so that it takes no space on the disk."""

    def _write(self, buffers: list[bytes]) -> None:
        total = sum(map(len, buffers))
        small = [each for each in buffers if each is not ZEROS]
        place = self.size
        if len(small) == len(buffers):
            super()._write(buffers)
            return
        for each in buffers:
            if each is not ZEROS:
                os.pwrite(self._file, each, place)
            place += len(each)
        self.size += total


ZEROS = bytes(CHUNK_BYTES)


def opening() -> dict[str, Any]:
    """Open a file of 10 GB, and say what is in it."""
    with tempfile.TemporaryDirectory(dir=os.environ.get("ZV_BENCH_FOLDER")) as folder:
        writer = _Sparse(Path(folder) / "large.mcap", {"namespace": "vision"}, chunk_bytes=1)
        number = 0
        while writer.size < LARGE_BYTES:
            at_ns = 1_700_000_000_000_000_000 + number * 100_000_000
            writer.add(
                Record("vision/front/image/compressed", ZEROS, "image/jpeg", None, None, at_ns)
            )
            number += 1
        path = writer.close()
        begun_s = time.perf_counter()
        with Recording(path) as opened:
            opened_s = time.perf_counter() - begun_s
            middle = (opened.start_ns + opened.end_ns) // 2
            next(opened.records(start_ns=middle))
            found_s = time.perf_counter() - begun_s
            size = opened.size
        path.rename(path.with_suffix(".partial"))
        os.truncate(path.with_suffix(".partial"), size - 1000)
        begun_s = time.perf_counter()
        with Recording(path.with_suffix(".partial")):
            without_s = time.perf_counter() - begun_s
    return {
        "GB": round(size / 1e9, 2),
        "open_s": round(opened_s, 3),
        "record_in_the_middle_s": round(found_s, 3),
        "open_without_index_s": round(without_s, 3),
    }


def publish(endpoint: str) -> None:
    """Publish four cameras of JPEGs from memory, with tracks and contours, until killed."""
    pictures = [encode_jpeg(each, "bgr8", QUALITY) for each in frames(WIDTH, HEIGHT)[:10]]
    session = open_session(Connection(connect=endpoint, timeout_s=60))
    box = {"state": "confirmed", "x": 5.0, "y": 5.0, "box": [1, 2, 30, 40], "area": 9.0}
    tracks = [{"id": number, **box} for number in range(TRACKS)]
    contours = [{"points": [[1, 2]] * 8, "length": 9.0, "closed": False}] * CONTOURS
    epoch, begun_s, seq = time.time_ns(), time.monotonic(), 0
    names = ("image/compressed", "tracks", "edges/contours")
    publishers = {
        (camera, name): session.declare_publisher(
            f"vision/{camera}/{name}", congestion_control=zenoh.CongestionControl.BLOCK
        )
        for camera in CAMERAS
        for name in names
    }
    while True:
        for index, camera in enumerate(CAMERAS):
            due_s = begun_s + (seq + index / len(CAMERAS)) / RATE_HZ
            time.sleep(max(0.0, due_s - time.monotonic()))
            header = {
                "camera": camera,
                "epoch": epoch,
                "seq": seq,
                "stamp_ns": time.time_ns(),
                "width": WIDTH,
                "height": HEIGHT,
                "encoding": "bgr8",
                "node": f"camera_{camera}",
            }
            packed = msgpack.packb(header)
            picture = pictures[seq % len(pictures)]
            publishers[camera, names[0]].put(picture, encoding="image/jpeg", attachment=packed)
            for name, kind, fields in (
                (names[1], "Tracks", {"tracks": tracks}),
                (names[2], "Contours", {"density": 0.1, "contours": contours, "segments": []}),
            ):
                publishers[camera, name].put(
                    msgpack.packb({"header": header, **fields}),
                    encoding=f"application/msgpack;vision.{kind}.v1",
                    attachment=packed,
                )
        seq += 1


if __name__ == "__main__":
    publish(sys.argv[1])
