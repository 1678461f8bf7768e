"""A plain subscriber in a container of its own: one JSON line for each sample, until it is ended.

Needs nothing but zenoh and msgpack: ``python listener.py ENDPOINT KEY...``.
"""

from __future__ import annotations

import json
import signal
import sys
import threading
import time

import msgpack
import zenoh


def main() -> None:
    endpoint, *keys = sys.argv[1:]
    config = zenoh.Config()
    for name, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
        "transport/shared_memory/enabled": False,
    }.items():
        config.insert_json5(name, json.dumps(value))
    lock = threading.Lock()

    def on_sample(sample: zenoh.Sample) -> None:
        at_ns = time.time_ns()
        header = msgpack.unpackb(sample.attachment.to_bytes())
        identity = {name: header[name] for name in ("epoch", "seq", "stamp_ns")}
        arrival = {"key": str(sample.key_expr), "at_ns": at_ns, "bytes": len(sample.payload)}
        with lock:
            print(json.dumps(identity | arrival), flush=True)

    ended = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.set())
    with zenoh.open(config) as session:
        handler = zenoh.handlers.Callback(on_sample, indirect=False)
        kept = [session.declare_subscriber(key, handler) for key in keys]
        while kept and not ended.wait(0.1):
            pass


if __name__ == "__main__":
    main()
