"""Print the position of the largest moving object, with zenoh and msgpack only.

python examples/subscribe.py [tcp/127.0.0.1:7447]      Ctrl-C ends it
"""

import json
import sys
import time
from contextlib import suppress

import msgpack
import zenoh

endpoint = sys.argv[1] if len(sys.argv) > 1 else "tcp/127.0.0.1:7447"
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
with suppress(KeyboardInterrupt), zenoh.open(config) as session:
    newest_only = zenoh.handlers.RingChannel(1)  # the default queues 256 samples, oldest first
    subscriber = session.declare_subscriber("vision/front/centroid", newest_only)
    for sample in subscriber:
        centroid = msgpack.unpackb(sample.payload.to_bytes())
        camera, seq = centroid["header"]["camera"], centroid["header"]["seq"]
        age_ms = (time.time_ns() - centroid["header"]["stamp_ns"]) / 1e6
        print(camera, seq, centroid["x"], centroid["y"], f"{age_ms:.1f} ms", flush=True)
