"""Reads devices by ``DeviceSource`` and by OpenCV's capture, in the virtual machine of the tests.

Age is from the driver's stamp to decoded pixels; the CPU time is that of this process, without the
driver's own. The machine is five to fifteen times slower than this one: compare the two columns,
not the figures with others.

    python -m benchmarks --only-devices
"""

from __future__ import annotations

import json
import multiprocessing
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path

import cv2

from tests.devices import machine
from tests.support.cameras.drivers import LOOPBACK, writing
from tests.support.pictures.videos import jpeg_of
from zenoh_vision.keys import JPEG
from zv.camera.sources.base import DeviceWish
from zv.camera.sources.device import DeviceSource
from zv.camera.sources.v4l2.controls import Controls
from zv.camera.sources.v4l2.driver import Driver

SIZE = (640, 360)
RATE_HZ = 15
FRAMES = 60
UNMEASURED = 5
"""The first pictures, which wait while caches are cold."""

FORMATS = {"YUYV": "/dev/video0", "NV12": "/dev/video0", "MJPG": LOOPBACK}

Ages = Iterator[float]


def measure() -> int:
    """Run the measurements in the virtual machine, which prints them; return its exit status."""
    words = [sys.executable, "-m", "benchmarks.devices"]
    return machine.run(words, loopback=1, seconds=900)


def with_device_source(device: str, fourcc: str) -> Ages:
    """Yield the ages of decoded pictures, seconds, as ``zv camera`` reads them."""
    wish = DeviceWish(fourcc, *SIZE, None if device == LOOPBACK else RATE_HZ)
    with closing(DeviceSource(device, wish)) as source:
        while True:
            read = source.read()
            assert read.picture.pixels.shape[:2] == SIZE[::-1]
            assert read.stamp_ns is not None
            yield (time.time_ns() - read.stamp_ns) / 1e9


def with_opencv(device: str, fourcc: str) -> Ages:
    """Yield the ages of decoded pictures, seconds, as OpenCV reads them."""
    capture = cv2.VideoCapture(device, cv2.CAP_V4L2)
    capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*fourcc))
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, SIZE[0])
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, SIZE[1])
    capture.set(cv2.CAP_PROP_FPS, RATE_HZ)
    try:
        while True:
            taken, pixels = capture.read()
            assert taken
            assert pixels.shape[:2] == SIZE[::-1], pixels.shape
            yield time.monotonic() - capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
    finally:
        capture.release()


def passed_on(device: str, fourcc: str) -> Ages:
    """Yield the ages of JPEGs that are not decoded, seconds: what ``zv camera`` does with them."""
    with closing(DeviceSource(device, DeviceWish(fourcc, *SIZE))) as source:
        while True:
            read = source.read()
            assert read.picture.form == JPEG
            assert read.stamp_ns is not None
            yield (time.time_ns() - read.stamp_ns) / 1e9


WAYS: dict[str, Callable[[str, str], Ages]] = {
    "zv camera": with_device_source,
    "OpenCV": with_opencv,
}


def figures(ages: Ages) -> dict[str, float]:
    """Return the median and largest age, and the CPU time of a picture, ms."""
    for _ in range(UNMEASURED):
        next(ages)
    cpu_s, found = time.process_time(), [next(ages) for _ in range(FRAMES)]
    cpu_s = time.process_time() - cpu_s
    return {
        "age_ms": round(statistics.median(found) * 1e3, 2),
        "age_max_ms": round(max(found) * 1e3, 2),
        "cpu_ms": round(cpu_s / FRAMES * 1e3, 2),
    }


@contextmanager
def written(pictures: list[bytes]) -> Iterator[None]:
    """Show JPEGs on the device of v4l2loopback, from a process whose CPU time is not measured."""
    processes = multiprocessing.get_context("fork")
    begun, over = processes.Event(), processes.Event()

    def write() -> None:
        with writing(pictures, "MJPG", SIZE):
            begun.set()
            over.wait()

    process = processes.Process(target=write)
    process.start()
    try:
        assert begun.wait(30)
        yield
    finally:
        over.set()
        process.join()


def main() -> None:
    """Measure and print, one JSON object for each format; inside the virtual machine."""
    cv2.setNumThreads(1)
    # vivid calculates the end of a picture beforehand, and delivers it earlier.
    driver = Driver(FORMATS["YUYV"])
    Controls(driver).set({"timestamp_source": "Start of Exposure"})
    driver.close()
    for fourcc, device in FORMATS.items():
        picture = cv2.resize(cv2.imread(str(scene())), SIZE)
        source = written([jpeg_of(picture)]) if device == LOOPBACK else nullcontext()
        found = {}
        with source:
            ways = WAYS if fourcc != "MJPG" else {**WAYS, "zv camera, passed on": passed_on}
            for name, way in ways.items():
                with closing(way(device, fourcc)) as ages:  # type: ignore[type-var]
                    found[name] = figures(ages)
        print(json.dumps({fourcc: found}), flush=True)


def scene() -> Path:
    """Return a picture of a real place that is part of the project."""
    return Path(__file__).parents[1] / "docs/images/edges/canny_0_input.png"


if __name__ == "__main__":
    main()
