"""Twenty cameras in one process, fed from memory: ENDPOINT STREAMS WIDTH HEIGHT RATE."""

from __future__ import annotations

import sys
import time

from benchmarks.material import frames
from zenoh_vision.image.codecs import encode_jpeg
from zenoh_vision.messages import Header
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.publisher import FRAME_DELIVERY
from zenoh_vision.transport.session import open_session

QUALITY = 80


def main() -> None:
    """Publish until SIGTERM: on each key a JPEG with a header, the streams one after the other."""
    endpoint, streams, width, height = sys.argv[1], *map(int, sys.argv[2:5])
    rate_hz = float(sys.argv[5])
    jpegs = [encode_jpeg(picture, "bgr8", QUALITY) for picture in frames(width, height)]
    session = open_session(Connection(connect=endpoint, timeout_s=20))
    congestion_control, priority = FRAME_DELIVERY
    names = [f"c{index}" for index in range(streams)]
    publishers = [
        session.declare_publisher(
            f"vision/{name}/image/compressed",
            encoding="image/jpeg",
            congestion_control=congestion_control,
            priority=priority,
        )
        for name in names
    ]
    epoch, begun_s = time.time_ns(), time.monotonic()
    for count in range(sys.maxsize):
        seq, index = divmod(count, streams)
        time.sleep(max(0.0, begun_s + count / streams / rate_hz - time.monotonic()))
        header = Header(
            camera=names[index],
            epoch=epoch,
            seq=seq,
            stamp_ns=time.time_ns(),
            width=width,
            height=height,
            encoding="bgr8",
            node=f"camera_{names[index]}",
        )
        publishers[index].put(jpegs[seq % len(jpegs)], attachment=header.to_bytes())


if __name__ == "__main__":
    main()
