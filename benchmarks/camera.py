"""The real camera service alone, fed from memory: WIDTH HEIGHT RATE ENDPOINT [NAME]."""

from __future__ import annotations

import os
import sys

from benchmarks.material import MemorySource, frames
from benchmarks.system import CREDENTIALS
from zenoh_vision.transport.connection import Connection
from zv.camera.service import run
from zv.camera.settings import CameraSettings


def main() -> None:
    """Publish until SIGTERM."""
    width, height, rate_hz = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    pictures = frames(width, height)
    # Named as a file, a source that may repeat its pictures.
    name = sys.argv[5] if len(sys.argv) > 5 else "front"
    settings = CameraSettings(camera=name, source=__file__)
    connection = Connection(connect=sys.argv[4], credentials=os.environ.get(CREDENTIALS))
    run(settings, connection, lambda *_: MemorySource(pictures, rate_hz))


if __name__ == "__main__":
    main()
