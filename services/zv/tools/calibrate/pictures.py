"""The grey pictures that a calibration looks at: of a folder, or of a camera's stream."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from zenoh_vision.errors import (
    ConfigurationError,
    ExpectationNotMet,
    PayloadError,
    SourceError,
)
from zenoh_vision.image import codecs
from zenoh_vision.stream.buffer import latest
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.frame_intake import FrameIntake
from zenoh_vision.stream.intake import Consumer
from zenoh_vision.topics import COMPRESSED
from zenoh_vision.transport.subscriber import subscribe
from zv.tools.calibrate.board import Board, Gray
from zv.tools.calibrate.options import BoardOptions
from zv.tools.shared.session import ToolSession

SUFFIXES: Final = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")
POLL_S: Final = 0.1
SILENT_S: Final = 5.0


def board_of(options: BoardOptions) -> Board:
    """Return the board that the options describe.

    Raises:
        ConfigurationError: Its size or its squares are not given.
    """
    if options.size is None or options.square is None:
        raise ConfigurationError(
            "the board must be described: --size COLUMNSxROWS and --square SIDE, such as "
            "--size 9x6 --square 25"
        )
    columns, rows = options.columns_rows
    marker = options.square * 0.75 if options.marker is None else options.marker
    return Board(options.board, columns, rows, options.square, marker, options.dictionary)


def from_folder(folder: str, skipped: Callable[[str], None]) -> Iterator[tuple[str, Gray]]:
    """Yield name and picture of each image file of a folder, in the order of their names.

    ``skipped`` is called with the reason for each file that cannot be read.

    Raises:
        SourceError: It cannot be read, or has no images.
    """
    try:
        files = sorted(each for each in Path(folder).iterdir() if each.suffix.lower() in SUFFIXES)
    except OSError as error:
        raise SourceError(f"{folder}: {error.strerror or error}") from None
    if not files:
        raise SourceError(f"{folder}: no pictures in this folder; allowed: {', '.join(SUFFIXES)}")
    for path in files:
        try:
            yield path.name, read_gray(path)
        except SourceError as error:
            skipped(str(error))


def read_gray(path: str | Path) -> Gray:
    """Read an image file as grey, (height, width), as the sensor saw it.

    Its Exif orientation is ignored: how the camera was held does not turn the lens before the
    sensor.

    Raises:
        SourceError: It cannot be opened, or is not an image.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror or error}") from None
    try:
        if data.startswith((codecs.JPEG_START, codecs.PNG_START)):
            codecs.picture_size(data)  # a forged size would ask for gigabytes
        flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    except (cv2.error, PayloadError) as error:
        raise SourceError(f"{path}: {error}") from None
    if pixels is None:
        raise SourceError(f"{path}: not an image that can be decoded")
    return np.asarray(pixels, np.uint8)


def from_stream(session: ToolSession, camera: str, for_s: float) -> Iterator[Gray]:
    """Yield the newest picture of a camera each time, until the time is over or told to stop.

    Raises:
        ExpectationNotMet: No picture came for five seconds.
    """
    key = COMPRESSED.key(session.namespace, camera)
    intake = FrameIntake(key, Consumer(FrameCounters(), dropped=lambda _: None), latest)
    subscribe(session.link, intake)
    end_s = last_s = time.monotonic()
    end_s += for_s
    while not session.stopping and (now_s := time.monotonic()) < end_s:
        frame = intake.take(POLL_S, "gray", None)
        if frame is not None:
            last_s = now_s
            yield frame.gray
        elif now_s - last_s > SILENT_S:
            raise ExpectationNotMet(
                f"no picture on {key} for {SILENT_S:g} s; is the camera running?"
            )
