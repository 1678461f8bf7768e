"""Fetch a camera's newest frame with a query and save it unchanged.

python examples/save_frame.py FILE.jpg [tcp/127.0.0.1:7447] [KEY]
"""

import json
import sys
from pathlib import Path

import zenoh

# A client is back 0.2 s after its router; by Zenoh's default after seconds.
RETRY = {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 2}

given = sys.argv[1:] + [None] * 3
endpoint = given[1] or "tcp/127.0.0.1:7447"
key = given[2] or "vision/front/image/compressed"
config = {"mode": "client", "connect": {"endpoints": [endpoint], "retry": RETRY}}
try:
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
except zenoh.ZError:
    sys.exit(f"no router at {endpoint} (tcp/ADDRESS:PORT); start one: zv router")
with session:
    replies = list(session.get(key, timeout=2.0))
if not replies:
    sys.exit(f"nobody answered on {key}")
if replies[0].err:  # a camera with max_kbps refuses too many queries
    sys.exit(f"{key}: {replies[0].err.payload.to_string()}")
try:
    Path(given[0] or "frame.jpg").write_bytes(replies[0].ok.payload.to_bytes())
except OSError as error:
    sys.exit(f"{error.filename}: {error.strerror}")
