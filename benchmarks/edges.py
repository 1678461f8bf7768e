"""Measures each edge detector and output on one frame, beside the bare calls of OpenCV."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import cv2
import numpy as np

from benchmarks.material import frames
from zenoh_vision.image import codecs
from zenoh_vision.image.forms import pack_bits
from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Header
from zv.edge.detectors.available import DETECTORS
from zv.edge.finding import EdgesOfFrame
from zv.edge.settings import EdgeSettings

ROUNDS = 15


def measure(width: int, height: int) -> dict[str, Any]:
    """Return milliseconds and bytes of a frame, medians of rounds that take each in turn."""
    jpeg = codecs.encode_jpeg(frames(width, height)[0], "bgr8", 80)
    header = Header(
        camera="front", epoch=0, seq=0, stamp_ns=0, width=width, height=height, encoding="bgr8"
    )
    settings = {name: EdgeSettings.model_validate({"detector": name}) for name in DETECTORS}
    work: dict[str, Callable[[], bytes]] = {"bare cv2": partial(bare, jpeg)}
    for name, chosen in settings.items():
        work[f"{name}, png"] = partial(png, header, jpeg, chosen)
    canny = settings["canny"]
    work["canny, jpeg"] = partial(as_jpeg, header, jpeg, canny)
    work["canny, bits"] = partial(bits, header, jpeg, canny)
    work["canny, png and contours"] = partial(contours, header, jpeg, canny)
    work["canny, png and all steps"] = partial(steps, header, jpeg, canny)
    times: dict[str, list[float]] = {name: [] for name in work}
    sizes = {}
    for _ in range(ROUNDS):
        for name, run in work.items():
            begun = time.perf_counter()
            made = run()
            times[name].append((time.perf_counter() - begun) * 1e3)
            sizes[name] = len(made)
    floor = float(np.median(times["bare cv2"]))
    return {
        name: {
            "ms": round(float(np.median(taken)), 3),
            "bytes": sizes[name],
            "ratio_to_bare": round(float(np.median(taken)) / floor, 3),
        }
        for name, taken in times.items()
    }


def bare(jpeg: bytes) -> bytes:
    """Decode to grey, smooth, find edges, encode with one bit a pixel: OpenCV alone."""
    gray = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
    edges = cv2.Canny(cv2.GaussianBlur(gray, (0, 0), 1.4), 40, 100, L2gradient=True)
    options = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_BILEVEL, 1]
    return cv2.imencode(".png", edges, options)[1].tobytes()


def found(header: Header, jpeg: bytes, settings: EdgeSettings) -> EdgesOfFrame:
    """Return the edges of a frame that just arrived."""
    return EdgesOfFrame(Frame(header, jpeg), settings)


def png(header: Header, jpeg: bytes, settings: EdgeSettings) -> bytes:
    """Return the edge map as the service sends it."""
    return codecs.encode_png(found(header, jpeg, settings).edges, bilevel=True)


def as_jpeg(header: Header, jpeg: bytes, settings: EdgeSettings) -> bytes:
    """Return the edge map as a JPEG."""
    return codecs.encode_jpeg(found(header, jpeg, settings).edges, "mono8", settings.quality)


def bits(header: Header, jpeg: bytes, settings: EdgeSettings) -> bytes:
    """Return the edge map as packed bits."""
    return pack_bits(found(header, jpeg, settings).edges)


def contours(header: Header, jpeg: bytes, settings: EdgeSettings) -> bytes:
    """Return the message with the lines, after the map was encoded too; its bytes alone."""
    edges = found(header, jpeg, settings)
    codecs.encode_png(edges.edges, bilevel=True)
    return edges.message(lambda: header).to_bytes()


def steps(header: Header, jpeg: bytes, settings: EdgeSettings) -> bytes:
    """Return all steps as PNGs, one after the other, after the map was encoded too."""
    edges = found(header, jpeg, settings)
    codecs.encode_png(edges.edges, bilevel=True)
    return b"".join(codecs.encode_png(make()) for make in edges.stages.values())
