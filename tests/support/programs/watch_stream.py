"""Watches a viewer's stream as a program does: one JSON line for each picture, until it is ended.

Needs nothing but Python: ``python watch_stream.py PORT TOPIC``.
"""

from __future__ import annotations

import json
import sys
import time
import urllib.request
from decimal import Decimal


def main() -> None:
    """Print capture time, arrival and size of each picture."""
    port, topic = sys.argv[1:]
    url = f"http://127.0.0.1:{port}/stream?topic={topic}"
    with urllib.request.urlopen(url, timeout=30) as stream:
        fields: dict[str, str] = {}
        while line := stream.readline():
            name, colon, value = line.decode().strip().partition(": ")
            if colon:
                fields[name] = value
            elif not name and "Content-Length" in fields:
                size = len(stream.read(int(fields["Content-Length"])))
                stamp_ns = int(Decimal(fields["X-Timestamp"]) * 10**9)
                seen = {"stamp_ns": stamp_ns, "at_ns": time.time_ns(), "bytes": size}
                print(json.dumps(seen), flush=True)
                fields = {}


if __name__ == "__main__":
    main()
