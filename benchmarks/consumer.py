"""A subscriber in a process of its own: decodes each frame and notes its age.

ENDPOINT FRAMES [TRANSPORT]: prints one line of JSON with the ages (ms), the seconds and CPU time
they took.
"""

from __future__ import annotations

import json
import os
import sys
import time
from typing import Any

from benchmarks.system import CREDENTIALS
from zenoh_vision.node.node import Node
from zenoh_vision.transport.connection import Connection

WARM_UP = 30


def main() -> None:
    """Receive the given number of frames and report."""
    wanted = int(sys.argv[2])
    transport: Any = (*sys.argv, "jpeg")[3]
    ages: list[float] = []
    connection = Connection(connect=sys.argv[1], credentials=os.environ.get(CREDENTIALS))
    with Node("bench", connection=connection) as node:
        frames = node.frames("image/compressed", want="bgr", transport=transport)
        for count, frame in enumerate(frames):
            now_ns = time.time_ns()
            if count == WARM_UP:
                cpu_s, start_s = time.process_time(), time.monotonic()
                first = frame.header.seq
            if count >= WARM_UP:
                ages.append((now_ns - frame.header.stamp_ns) / 1e6)
            if len(ages) == wanted:
                break
        lost = frame.header.seq - first + 1 - wanted
        print(
            json.dumps(
                {
                    "ages_ms": ages,
                    "cpu_s": time.process_time() - cpu_s,
                    "seconds": time.monotonic() - start_s,
                    "lost": lost,
                }
            )
        )


if __name__ == "__main__":
    main()
