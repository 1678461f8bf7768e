"""One side of shared memory until it is killed: ``write OFFER`` or ``read OFFER``, small frames."""

from __future__ import annotations

import sys
import time

import numpy as np

from tests.support.headers import header
from zenoh_vision.image.frame import Frame
from zenoh_vision.shm.reader import FrameReader
from zenoh_vision.shm.writer import FrameWriter


def write(offer: str, width: int = 320, height: int = 240) -> None:
    """Write frames, and print the number of each."""
    writer = FrameWriter(offer)
    pixels = np.full((height, width, 3), 7, np.uint8)
    for seq in range(10**9):
        sent = header(seq, stamp_ns=time.time_ns(), width=width, height=height)
        writer.write(Frame(sent, pixels))
        print(seq, flush=True)
        time.sleep(0.01)


def read(offer: str) -> None:
    """Print the number of each frame that arrives; keep the last ones."""
    kept = []
    with FrameReader(offer, "vision/front/image") as reader:
        while True:
            if (sample := reader.receive(0.1)) is not None:
                kept.append(sample)
                del sample, kept[:-2]
                print(len(kept), flush=True)


if __name__ == "__main__":
    {"write": write, "read": read}[sys.argv[1]](sys.argv[2])
