"""Wait for the first centroid at an endpoint; exit 1 if there is none within 20 s."""

import sys
import threading
import time

import zenoh

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["{sys.argv[1]}"]')
config.insert_json5("scouting/multicast/enabled", "false")
deadline = time.monotonic() + 20
while True:
    try:
        session = zenoh.open(config)
        break
    except zenoh.ZError:
        if time.monotonic() > deadline:
            sys.exit("no router")
        time.sleep(0.1)
seen = threading.Event()
subscriber = session.declare_subscriber("vision/front/centroid", lambda sample: seen.set())
found = seen.wait(max(0.0, deadline - time.monotonic()))
session.close()
sys.exit(0 if found else "no centroid")
