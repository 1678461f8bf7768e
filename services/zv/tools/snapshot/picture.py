"""A picture from the network: its identity, its file, and the detections drawn on it."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, PayloadError
from zenoh_vision.image import forms
from zenoh_vision.image.depth import RangeFinder
from zenoh_vision.image.exif import as_stored
from zenoh_vision.image.forms import FORMS, PictureForm
from zenoh_vision.image.frame import Frame
from zenoh_vision.keys import JPEG, PNG, type_of
from zenoh_vision.messages import Header
from zenoh_vision.stream.frame_intake import snapshot_of
from zenoh_vision.stream.sample import Sample
from zenoh_vision.topics import topic_of
from zv.tools.snapshot.options import STDOUT

PNG_DEPTH = 24
"""Offset of the bits per channel in a PNG."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture that arrived: the sample, its form, and its frame."""

    sample: Sample
    form: PictureForm
    frame: Frame

    @property
    def header(self) -> Header | None:
        """The header that the sender made; None if there was none."""
        attachment = self.sample.attachment
        return None if attachment is None else Header.from_bytes(attachment)

    @property
    def age_s(self) -> float | None:
        """Seconds from its capture, or its replay, to its arrival here; None without a header."""
        if self.header is None:
            return None
        return (self.sample.received_ns - self.header.age_start_ns) / 1e9

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

        Only an Exif orientation is left out, by which programs would turn it.

        Raises:
            ConfigurationError: A JPEG cannot represent it.
        """
        mime = self.form.encoding
        form = form_of(output, default=mime if mime in (JPEG, PNG) else PNG)
        if form == JPEG and self._has_16_bits(mime):
            raise ConfigurationError(
                f"{self.sample.key} has 16 bits per channel, which a JPEG cannot represent: "
                f"-o {PurePath(output).with_suffix('.png')}"
            )
        if form == mime:
            payload = bytes(self.sample.payload)
            return as_stored(payload) if form == JPEG else payload
        picture = self.frame.picture
        return picture.jpeg(quality) if form == JPEG else picture.png()

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
    topic = topic_of(sample.key)
    default = JPEG if topic is None or topic.message else topic.encoding
    form = forms.form_of(sample.encoding, sample.payload, default)
    # Programs that are not nodes may leave the encoding away, also that of raw pixels.
    unnamed = type_of(sample.encoding) == "-" and form.needs_header and sample.attachment
    known = (sample.encoding in FORMS and form.needs_header) or unnamed or sample.deleted
    if not known and not bytes(sample.payload).startswith(form.signature or b"\0none"):
        kind = type_of(sample.encoding)
        raise ConfigurationError(
            f"{sample.key} carries {sample.encoding if kind == '-' else kind}, no picture; "
            f"zv topic echo {shlex.quote(sample.key)} --once shows it"
        )
    try:
        frame = snapshot_of(sample, default)
        frame.find_range(RangeFinder())  # for --draw
        frame.gray  # noqa: B018 - refuses a damaged picture, even if it is saved unchanged
    except PayloadError as error:
        raise ExpectationNotMet(f"{sample.key}: {error}") from None
    return Picture(sample, form, frame)


def form_of(output: str, *, default: str) -> str:
    """Return ``image/jpeg`` or ``image/png`` by a file name's extension; the default for ``-``."""
    if output == STDOUT:
        return default
    return PNG if PurePath(output).suffix.lower() == ".png" else JPEG
