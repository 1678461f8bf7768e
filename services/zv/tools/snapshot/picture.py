"""A picture from the network: its identity, its file, and the detections drawn on it."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, PayloadError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.depth import RangeFinder
from zenoh_vision.image.frame import Frame
from zenoh_vision.keys import BITS, JPEG, PNG, RAW_IMAGE, UNCOMPRESSED, type_of
from zenoh_vision.messages import Centroid, Header, Tracks
from zenoh_vision.stream.frame_intake import snapshot_of
from zenoh_vision.stream.sample import Sample
from zenoh_vision.topics import RAW, topic_of
from zv.tools.snapshot.options import STDOUT

PNG_DEPTH = 24
"""Offset of the bits per channel in a PNG."""


GREEN = (0, 255, 0)
COLOURS = (GREEN, (0, 191, 255), (255, 128, 0), (255, 0, 255), (0, 255, 255), (128, 128, 255))
"""BGR colours, assigned in turn by the track's id."""

FAR = 1 << 20
TEXT_HEIGHT_SHARE = 0.03
FONT_PIXELS = 22.0
"""Height of OpenCV's plain font at scale 1."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture that arrived: the sample, and its frame."""

    sample: Sample
    frame: Frame

    @property
    def header(self) -> Header | None:
        """The header that the sender made; None if there was none."""
        attachment = self.sample.attachment
        return None if attachment is None else Header.from_bytes(attachment)

    @property
    def age_s(self) -> float | None:
        """Seconds from its capture to its arrival here; None without a header."""
        if self.header is None:
            return None
        return (self.sample.received_ns - self.header.stamp_ns) / 1e9

    def text(self) -> str:
        """Return identity and age as text."""
        header, age_s = self.header, self.age_s
        if header is None or age_s is None:
            return f"{self.sample.key}: no header, so neither identity nor age is known"
        return (
            f"{self.sample.key}: {header.camera} epoch {header.epoch} seq {header.seq}, "
            f"{header.width}x{header.height} {header.encoding}, "
            f"by {header.node or 'someone'}, {age_s * 1e3:.1f} ms old"
        )

    def record(self) -> dict[str, Any]:
        """Return identity and age for JSON."""
        header, age_s = self.header, self.age_s
        return {
            "key": self.sample.key,
            "age_ms": None if age_s is None else round(age_s * 1e3, 3),
            "header": None if header is None else header.to_map(),
        }

    def file(self, output: str, quality: int) -> bytes:
        """Return the picture as a JPEG or PNG file, unchanged if ``output`` has the same format.

        Raises:
            ConfigurationError: A JPEG cannot represent it.
        """
        mime = RAW_IMAGE if is_raw(self.sample) else self.sample.encoding
        if mime not in UNCOMPRESSED:
            mime = self.frame.mime
        form = form_of(output, default=PNG if mime in UNCOMPRESSED else mime)
        if form == JPEG and self._has_16_bits(mime):
            raise ConfigurationError(
                f"{self.sample.key} has 16 bits per channel, which a JPEG cannot represent: "
                f"-o {PurePath(output).with_suffix('.png')}"
            )
        if form == mime:
            return bytes(self.sample.payload)
        depth = self.frame.depth
        if depth is not None:
            return codecs.encode_png(depth)
        return encoded(self.frame.pixels, self.frame.header.encoding or "", form, quality)

    def _has_16_bits(self, mime: str) -> bool:
        if mime == PNG:  # regardless of a header that was assumed here
            return bytes(self.sample.payload[PNG_DEPTH : PNG_DEPTH + 1]) == b"\x10"
        return self.frame.is_deep


def checked(sample: Sample) -> Picture:
    """Return the picture in a sample, after the same checks as in a service.

    Raises:
        ConfigurationError: The key carries something else.
        ExpectationNotMet: The picture or its header is damaged.
    """
    raw = is_raw(sample)
    known = raw or sample.deleted or sample.encoding == BITS
    if not known and codecs.picture_type(bytes(sample.payload)) is None:
        kind = type_of(sample.encoding)
        raise ConfigurationError(
            f"{sample.key} carries {sample.encoding if kind == '-' else kind}, no picture; "
            f"zv topic echo {shlex.quote(sample.key)} --once shows it"
        )
    try:
        frame = snapshot_of(sample, raw=raw, finder=RangeFinder())  # for --draw
        frame.form("gray")  # refuse a damaged picture, even if it is saved unchanged
    except PayloadError as error:
        raise ExpectationNotMet(f"{sample.key}: {error}") from None
    return Picture(sample, frame)


def is_raw(sample: Sample) -> bool:
    """Tell whether a sample is raw pixels, by its Zenoh encoding, else by the topic of its key.

    Programs that are not nodes may leave the encoding away; the key then says what it is.
    """
    if sample.encoding == RAW_IMAGE:
        return True
    has_header = sample.attachment is not None
    return has_header and topic_of(sample.key) is RAW and type_of(sample.encoding) == "-"


def form_of(output: str, *, default: str) -> str:
    """Return ``image/jpeg`` or ``image/png`` by a file name's extension; the default for ``-``."""
    if output == STDOUT:
        return default
    return PNG if PurePath(output).suffix.lower() == ".png" else JPEG


def encoded(pixels: pixel_formats.Pixels, encoding: str, form: str, quality: int) -> bytes:
    """Return pixels, (height, width[, channels]), as a file; ``quality`` is for JPEG only."""
    if form == JPEG:
        return codecs.encode_jpeg(pixels, encoding, quality)
    if encoding in ("rgb8", "rgba8"):  # a PNG is written from BGR
        pixels = pixel_formats.convert(pixels, encoding, encoding.replace("rgb", "bgr"))
    return codecs.encode_png(pixels)


def draw(bgr: NDArray[np.uint8], result: Centroid | Tracks) -> NDArray[np.uint8]:
    """Return a picture with a box, a centre and a label for each detected object.

    Args:
        bgr: (height, width, 3) uint8; not modified. May be smaller than the frame.
        result: Of the same frame, in pixels of the full frame.
    """
    picture = bgr.copy()
    height, width = bgr.shape[:2]
    scale = width / result.header.width, height / result.header.height
    if isinstance(result, Tracks):
        for track in result.tracks:
            colour = COLOURS[track.id % len(COLOURS)]
            label = f"{track.id}" if track.state == "confirmed" else f"{track.id} {track.state}"
            _mark(picture, track.box, (track.x, track.y), label, colour, scale)
    elif result.box is not None and result.x is not None and result.y is not None:
        label = f"x: {result.x}, y: {result.y}"
        _mark(picture, result.box, (result.x, result.y), label, GREEN, scale)
    return picture


def _mark(
    picture: NDArray[np.uint8],
    box: tuple[int, int, int, int],
    centre: tuple[float, float],
    label: str,
    colour: tuple[int, int, int],
    scale: tuple[float, float],
) -> None:
    x, y, width, height = box
    points = np.array([(x, y), (x + width, y + height), centre]) * scale
    # OpenCV cannot represent coordinates too far outside.
    corner, opposite, middle = points.round().clip(-FAR, FAR).astype(int).tolist()
    size = max(10.0, picture.shape[0] * TEXT_HEIGHT_SHARE)
    thick = max(1, round(size / 8))
    cv2.rectangle(picture, corner, opposite, colour, thick)
    cv2.circle(picture, middle, 2 * thick, colour, -1)
    baseline = (corner[0], max(round(size), corner[1] - thick - 2))
    font, font_scale = cv2.FONT_HERSHEY_SIMPLEX, size / FONT_PIXELS
    cv2.putText(picture, label, baseline, font, font_scale, colour, thick, cv2.LINE_AA)
