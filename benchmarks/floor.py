"""The minimum: encodes and decodes the same frames in one process, one thread, no network."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.image.codecs import decode_jpeg, encode_jpeg


@dataclass(frozen=True, slots=True)
class Floor:
    """Milliseconds a frame, median; and the CPU time of it."""

    encode_ms: float
    decode_ms: float
    cpu_ms: float
    kilobytes: float
    opencv_ms: float
    """The same with OpenCV's own encoder and decoder, wall time: what one would write first."""
    ages_ms: tuple[float, ...]
    """Encoding and decoding of each frame."""

    @property
    def total_ms(self) -> float:
        """The minimum time of a frame between capture and decoded pixels."""
        return self.encode_ms + self.decode_ms


def measure(
    pictures: list[NDArray[np.uint8]], rate_hz: float, seconds: float, quality: int = 80
) -> Floor:
    """Encode and decode at the rate of the system, so that caches and clocks are as cold."""
    encode, decode, sizes = [], [], []
    cpu_s = 0.0
    count = int(seconds * rate_hz)
    start = time.perf_counter()
    for index in range(count):
        time.sleep(max(0.0, start + index / rate_hz - time.perf_counter()))
        cpu_before = time.thread_time()
        before = time.perf_counter()
        jpeg = encode_jpeg(pictures[index % len(pictures)], "bgr8", quality)
        between = time.perf_counter()
        decode_jpeg(jpeg, "bgr8")
        after = time.perf_counter()
        cpu_s += time.thread_time() - cpu_before
        encode.append((between - before) * 1e3)
        decode.append((after - between) * 1e3)
        sizes.append(len(jpeg) / 1e3)
    # In a separate pass, since in between it would evict data from the caches.
    opencv_s = [opencv_round_trip(picture) for picture in pictures]
    return Floor(
        statistics.median(encode),
        statistics.median(decode),
        cpu_s / count * 1e3,
        statistics.median(sizes),
        statistics.median(opencv_s) * 1e3,
        tuple(map(sum, zip(encode, decode, strict=True))),
    )


def opencv_round_trip(picture: NDArray[np.uint8]) -> float:
    """Return the seconds that OpenCV takes to encode and decode a picture."""
    begun_s = time.perf_counter()
    _, jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 80])
    cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
    return time.perf_counter() - begun_s
