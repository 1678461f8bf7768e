"""Print the position of the largest moving object, with zenoh and msgpack only.

python examples/subscribe.py [tcp/127.0.0.1:7447]      Ctrl-C ends it
"""

import json
import sys
import time
from contextlib import suppress

import msgpack
import zenoh
from zenoh.handlers import RingChannel

# A client is back 0.2 s after its router; by Zenoh's default after seconds.
RETRY = {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 2}

endpoint = sys.argv[1] if len(sys.argv) > 1 else "tcp/127.0.0.1:7447"
config = {"mode": "client", "connect": {"endpoints": [endpoint], "retry": RETRY}}
try:
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
except zenoh.ZError:
    sys.exit(f"no router at {endpoint} (tcp/ADDRESS:PORT); start one: zv router")
with suppress(KeyboardInterrupt, BrokenPipeError), session, sys.stdout:  # all closed at the end
    subscriber = session.declare_subscriber("vision/front/centroid", RingChannel(1))  # the newest
    for sample in subscriber:
        found = msgpack.unpackb(sample.payload.to_bytes())
        camera, seq = found["header"]["camera"], found["header"]["seq"]
        age_ms = (time.time_ns() - found["header"]["stamp_ns"]) / 1e6
        print(camera, seq, found["x"], found["y"], f"{age_ms:.1f} ms", flush=True)
