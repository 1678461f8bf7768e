"""Publish bare JPEGs on ``vision/front/image/compressed``, without code of this project.

python examples/publish_from_anything.py [tcp/127.0.0.1:7447] [--header] [FILE.jpg ...]

Without files it draws a square that moves. Ctrl-C ends it.
"""

import itertools
import json
import sys
import time
from contextlib import suppress
from pathlib import Path

import cv2
import msgpack
import numpy as np
import zenoh

# A client is back 0.2 s after its router; by Zenoh's default after seconds.
RETRY = {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 2}

RATE_HZ = 10.0


def drawn_pictures():
    """Yield JPEGs of a square that moves."""
    for count in itertools.count():
        picture = np.full((240, 320, 3), 60, np.uint8)
        left = 20 + 8 * (count % 30)
        cv2.rectangle(picture, (left, 100), (left + 40, 140), (240, 240, 240), -1)
        yield cv2.imencode(".jpg", picture)[1].tobytes()


def header_of(jpeg, epoch, seq):
    """Return the attachment that identifies a picture's frame."""
    height, width = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR).shape[:2]
    identity = {"camera": "front", "epoch": epoch, "seq": seq, "stamp_ns": time.time_ns()}
    return msgpack.packb({**identity, "width": width, "height": height, "encoding": "bgr8"})


arguments = sys.argv[1:]
with_header = "--header" in arguments
endpoint = next((text for text in arguments if text.startswith("tcp/")), "tcp/127.0.0.1:7447")
files = [text for text in arguments if text not in ("--header", endpoint)]
try:
    given = [Path(file).read_bytes() for file in files]
except OSError as error:
    sys.exit(f"{error.filename}: {error.strerror}")
jpegs = itertools.cycle(given) if given else drawn_pictures()
config = {
    "mode": "client",
    "connect": {"endpoints": [endpoint], "retry": RETRY},
    "transport": {"shared_memory": {"enabled": False}},
}
try:
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
except zenoh.ZError:
    sys.exit(f"no router at {endpoint} (tcp/ADDRESS:PORT); start one: zv router")
with suppress(KeyboardInterrupt), session:
    publisher = session.declare_publisher(
        "vision/front/image/compressed",
        encoding="image/jpeg",
        congestion_control=zenoh.CongestionControl.BLOCK_FIRST,  # whole frames or none
    )
    epoch = time.time_ns()  # identifies this run of the camera
    for seq, jpeg in enumerate(jpegs):
        # Without a header, receivers create one on arrival and mark it as assumed.
        publisher.put(jpeg, attachment=header_of(jpeg, epoch, seq) if with_header else None)
        time.sleep(1 / RATE_HZ)
