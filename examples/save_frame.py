"""Save a camera's newest frame unchanged, with a query, which every stream answers.

python examples/save_frame.py FILE.jpg [tcp/127.0.0.1:7447] [KEY]
"""

import json
import sys
from pathlib import Path

import zenoh

given = sys.argv[1:] + [None] * 3
endpoint = given[1] or "tcp/127.0.0.1:7447"
key = given[2] or "vision/front/image/compressed"
config = {"mode": "client", "connect": {"endpoints": [endpoint]}}
try:
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
except zenoh.ZError:
    sys.exit(f"no router at {endpoint}; start one: zv router")
with session:
    samples = [reply.ok for reply in session.get(key, timeout=2.0) if reply.ok]
if not samples:
    sys.exit(f"nobody answered on {key}")
Path(given[0] or "frame.jpg").write_bytes(samples[0].payload.to_bytes())
