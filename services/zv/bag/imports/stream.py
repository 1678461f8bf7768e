"""The stream of a camera, as records."""

from __future__ import annotations

import msgpack

from zenoh_vision.image.picture import Picture
from zenoh_vision.keys import PNG
from zv.bag.record import Record


class CameraStream:
    """Makes records of a camera's pictures, with headers.

    What is no JPEG or PNG becomes a JPEG of this quality, or with ``lossless`` a PNG.
    """

    def __init__(self, namespace: str, camera: str, quality: int, *, lossless: bool) -> None:
        self._prefix = f"{namespace}/{camera}"
        self._camera, self._quality, self._lossless = camera, quality, lossless
        self._epoch: int | None = None
        self._seq = 0

    def frame(self, picture: Picture, stamp_ns: int, log_ns: int | None = None) -> Record:
        """Return the next frame."""
        if self._epoch is None:
            self._epoch = stamp_ns
        encoding = picture.mime
        if self._lossless and picture.form is None:
            payload, encoding = picture.png(), PNG
        else:
            payload = picture.compressed(self._quality)
        width, height = picture.size
        header = {
            "camera": self._camera,
            "epoch": self._epoch,
            "seq": self._seq,
            "stamp_ns": stamp_ns,
            "width": width,
            "height": height,
            "encoding": picture.encoding,
            "node": "import",
            "revision": 0,
        }
        self._seq += 1
        return Record(
            key=f"{self._prefix}/image/compressed",
            payload=payload,
            encoding=encoding,
            attachment=bytes(msgpack.packb(header)),
            log_time_ns=log_ns or stamp_ns,
        )
