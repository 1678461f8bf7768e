"""Writes frames to a /dev/shm of 8 MB of its own that becomes full; prints what happened as JSON.

Started by ``unshare``, so that the mount is this process's alone.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

from tests.support.headers import header
from tests.support.shm_reading import Reading
from zenoh_vision.image.frame import Frame
from zenoh_vision.shm.machine import MEMORY, SharedMemoryError
from zenoh_vision.shm.writer import FrameWriter
from zenoh_vision.stream.sample import Sample


def frame(seq: int, width: int, height: int) -> Frame:
    """Return a frame whose values are its number."""
    sent = header(seq, stamp_ns=time.time_ns(), width=width, height=height)
    return Frame(sent, np.full((height, width, 3), seq % 256, np.uint8))


def write(writer: FrameWriter, *frames: Frame) -> str:
    """Write frames, and return why that ended; empty if it did not."""
    try:
        for each in frames:
            writer.write(each)
            time.sleep(0.02)
    except SharedMemoryError as error:
        return str(error)
    return ""


def main() -> None:
    """Fill the memory in two ways, before the first frame and between two.

    The arguments are width and height of the small frames.
    """
    width, height = map(int, sys.argv[1:])
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", MEMORY], check=True)
    said = {}
    too_large = FrameWriter("large")
    said["a frame larger than the memory"] = write(too_large, frame(0, 1920, 1600))
    too_large.close()
    arrived: list[Sample] = []
    writer = FrameWriter("small")
    reader = Reading("small", arrived.append)
    said["while there is room"] = write(writer, frame(0, width, height))
    filler = Path(MEMORY) / "filler"
    with filler.open("wb", buffering=0) as file, suppress(OSError):
        while True:
            file.write(bytes(4096))
    # What has arrived is kept, so each frame needs a piece of memory that was not used before.
    said["when it has become full"] = write(
        writer, *(frame(seq, width, height) for seq in range(1, 9))
    )
    said["views stay"] = "" if all(len(set(bytes(one.payload))) == 1 for one in arrived) else "no"
    reader.close()
    writer.close()
    filler.unlink()
    again = FrameWriter("again")
    said["when there is room again"] = write(again, frame(0, width, height))
    again.close()
    json.dump(said, sys.stdout)


if __name__ == "__main__":
    main()
