"""Print when and where a gripper must be to pick an object that crossed a line.

It needs only zenoh and msgpack.

python examples/pick_from_belt.py LINE PICK_X [tcp/127.0.0.1:7447]      Ctrl-C ends it

LINE is the name of a line in the tracker's setting `lines`; the belt runs along X of the plane that
the camera is calibrated for, and the gripper waits at X = PICK_X, beyond the line.
"""

import json
import sys
from contextlib import suppress

import msgpack
import zenoh

# A client is back 0.2 s after its router; by Zenoh's default after seconds.
RETRY = {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 2}

try:
    line, pick_x = sys.argv[1], float(sys.argv[2])
except (IndexError, ValueError):
    sys.exit("usage: python examples/pick_from_belt.py LINE PICK_X [tcp/127.0.0.1:7447]")
endpoint = sys.argv[3] if len(sys.argv) > 3 else "tcp/127.0.0.1:7447"
config = {"mode": "client", "connect": {"endpoints": [endpoint], "retry": RETRY}}


def ask(session: zenoh.Session, track: int, at_ns: int) -> dict | None:
    """Return where a track will be at a time by the camera's clock; if unknown, print why."""
    for reply in session.get(f"vision/front/prediction?id={track};at_ns={at_ns}"):
        if reply.ok is not None:
            return msgpack.unpackb(reply.ok.payload.to_bytes())
        why = reply.err.payload.to_bytes()
        if str(reply.err.encoding).startswith("application/msgpack"):
            why = "{error}; allowed: {allowed}".format(**msgpack.unpackb(why))
        print(f"id {track}: {why}", file=sys.stderr)
    return None


try:
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
except zenoh.ZError:
    sys.exit(f"no router at {endpoint} (tcp/ADDRESS:PORT); start one: zv router")
with suppress(KeyboardInterrupt, BrokenPipeError), session, sys.stdout:  # all closed at the end
    subscriber = session.declare_subscriber("vision/front/events")
    for sample in subscriber:
        event = msgpack.unpackb(sample.payload.to_bytes())
        if event["event"] != "line_crossed" or event["zone"] != line:
            continue
        header, track = event["header"], event["id"]
        # A time before the newest frame is refused, and that may be later than the event's frame.
        soon = ask(session, track, header["stamp_ns"] + 1_000_000_000)
        if soon is None or soon["world"] is None or soon["world_velocity"][0] == 0:
            print(f"id {track}: no position on the belt", file=sys.stderr)
            continue
        left_s = (pick_x - soon["world"][0]) / soon["world_velocity"][0]
        at_ns = soon["stamp_ns"] + round(left_s * 1e9)
        there = ask(session, track, at_ns)
        if there is not None and there["world"] is not None:
            (x, y), (along, across) = there["world"], there["world_sigma"]
            after_s = (at_ns - event["stamp_ns"]) / 1e9
            print(
                f"id {track}: {after_s:.3f} s after the line, at {at_ns} ns: X {x:.1f} "
                f"+- {along:.1f}, Y {y:.1f} +- {across:.1f}",
                flush=True,
            )
