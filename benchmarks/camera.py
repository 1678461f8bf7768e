"""The real camera service in a process of its own, fed from memory: WIDTH HEIGHT RATE ENDPOINT."""

from __future__ import annotations

import sys

from benchmarks.material import MemorySource, frames
from common.connection import Connection
from services.camera.service import run
from services.camera.settings import CameraSettings


def main() -> None:
    """Publish until SIGTERM."""
    width, height, rate_hz = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    pictures = frames(width, height)
    # The name of the source matters only for the watch for repeats, which a file does not have.
    settings = CameraSettings(source=__file__)
    run(settings, Connection(connect=sys.argv[4]), lambda: MemorySource(pictures, rate_hz))


if __name__ == "__main__":
    main()
