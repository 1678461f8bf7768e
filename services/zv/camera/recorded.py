"""Reads the frames of one camera from a recording, in their recorded pace."""

from __future__ import annotations

import logging
from collections.abc import Generator
from pathlib import Path

from zenoh_vision import keys
from zenoh_vision.errors import PayloadError, SourceError
from zenoh_vision.image.picture import Picture
from zenoh_vision.stream.frame_intake import snapshot_of
from zenoh_vision.stream.sample import Sample
from zenoh_vision.topics import COMPRESSED, RAW
from zv.bag.record import Record
from zv.bag.recording import Recording
from zv.camera.sources.base import TimedPicture

log = logging.getLogger(__name__)


class RecordedSource:
    """The frames of one camera of a recording, once.

    JPEGs are passed on undecoded. A frame that cannot be read is skipped with a warning. Frames
    are due at the distance of their stamps, which are those of their capture.

    ``camera`` is the one to take if the recording has several.

    Raises:
        SourceError: It cannot be read, or has no frames, or those of several other cameras.
    """

    live = False
    rate_hz: float | None = None

    def __init__(self, path: Path | str, camera: str) -> None:
        path = Path(path)
        self._recording = Recording(path)
        try:
            key = _key(path, self._recording.keys(), camera)
            self._records = self._recording.records(keys=(key,))
            self._pictures = self._read()
            first = next(self._pictures, None)
            if first is None:
                raise SourceError(f"{path}: none of the frames on {key} can be read")
        except SourceError:
            self._recording.close()
            raise
        self._first: TimedPicture | None = first
        width, height = first.picture.size
        self.description = f"recording {path.name} ({key}, {width}x{height})"

    def read(self) -> TimedPicture | None:
        """Return the next picture, or None after the last one."""
        first, self._first = self._first, None
        return first or next(self._pictures, None)

    def close(self) -> None:
        """Close the file."""
        self._pictures.close()
        self._recording.close()

    def _read(self) -> Generator[TimedPicture, None, None]:
        begin_ns: int | None = None
        last_s = 0.0
        for record in self._records:
            if record.deleted:
                continue
            try:
                picture = _picture(record)
            except (PayloadError, ValueError) as error:
                log.warning("a recorded frame is skipped: %s", error)
                continue
            at_ns = record.number("stamp_ns") or record.log_time_ns
            if begin_ns is None:
                begin_ns = at_ns
            last_s = max(last_s, (at_ns - begin_ns) / 1e9)  # a clock that was set back
            yield TimedPicture(picture, due_s=last_s)


def _picture(record: Record) -> Picture:
    sample = Sample(record.key, record.payload, record.encoding, record.attachment)
    return snapshot_of(sample).picture


def _key(path: Path, recorded: list[str], camera: str) -> str:
    """Return the key of the frames that are read: compressed ones if there are both.

    Raises:
        SourceError: There are none, or the camera is not named and there are several.
    """
    found: dict[str, str] = {}
    for topic in (RAW, COMPRESSED):
        for key in recorded:
            if keys.suffix_of(key) == topic.name and not key.startswith("@"):
                found[keys.camera_of(key)] = key
    if not found:
        raise SourceError(f"{path}: no frames of a camera are in it")
    if camera in found:
        return found[camera]
    if len(found) > 1:
        names = ", ".join(sorted(found))
        raise SourceError(f"{path}: it has the cameras {names}, but not {camera}; --camera chooses")
    return next(iter(found.values()))
