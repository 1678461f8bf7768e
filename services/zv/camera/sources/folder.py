"""The images of a folder, one after the other."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from zenoh_vision.errors import PayloadError, SourceError
from zenoh_vision.image.files import images_in
from zv.camera.sources.base import TimedPicture
from zv.camera.sources.mjpeg import upright_picture

log = logging.getLogger(__name__)


class FolderSource:
    """The images of a folder in natural order (``frame2`` before ``frame10``), once.

    JPEG files are passed on undecoded. An image that cannot be read is skipped with a warning.

    ``path`` may be a single image too.

    Raises:
        SourceError: The folder does not exist, or has no readable image.
    """

    live = False

    def __init__(self, path: Path | str, *, rate_hz: float = 10.0) -> None:
        path = Path(path)
        files = images_in(path)
        pictures = _pictures(files, rate_hz)
        # Refuse a folder without a readable image here, not at the first ``read``.
        first = next(pictures, None)
        if first is None:
            raise SourceError(f"{path}: none of its {len(files)} images can be read")
        self._pictures = chain([first], pictures)
        self.rate_hz: float | None = rate_hz
        self.description = (
            f"{'folder' if path.is_dir() else 'image'} {path.name} "
            f"({len(files)} images, {first.picture.width}x{first.picture.height}, {rate_hz:g} Hz)"
        )

    def read(self) -> TimedPicture | None:
        """Return the next image, or None after the last one."""
        return next(self._pictures, None)

    def close(self) -> None:
        """Skip the images that are left."""
        self._pictures = chain()


def _pictures(files: list[Path], rate_hz: float) -> Iterator[TimedPicture]:
    count = 0
    for file in files:
        try:
            picture = upright_picture(file.read_bytes())
        except (OSError, ValueError, PayloadError) as error:
            log.warning("%s: skipped: %s", file, error)
        else:
            yield TimedPicture(picture, due_s=count / rate_hz)
            count += 1
