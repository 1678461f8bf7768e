"""Locks up a router of Zenoh 1.10: lists its publishers while publishers are declared.

zenoh #2619: the router keeps its tables locked while it replies, and each reply locks them again.
If a declaration waits for them in between, both wait for ever. This takes less than a second.
"""

from __future__ import annotations

import sys
import threading

import zenoh

from tests.support.listening import open_client
from zenoh_vision.transport.declarations import declared_key

ASKING, DECLARING, KEYS = 6, 4, 10
ANSWERED = threading.Event()
"""Cleared while the router answers nobody: what is declared then only takes the machine's time."""


def list_publishers(session: zenoh.Session) -> None:
    while True:
        if all(reply.ok for reply in session.get(declared_key("publisher", "**"), timeout=0.5)):
            ANSWERED.set()
        else:
            ANSWERED.clear()


def declare(session: zenoh.Session, name: int) -> None:
    number = 0
    while ANSWERED.wait():
        number += 1
        keys = (f"vision/camera{name}_{number}_{each}/image" for each in range(KEYS))
        for publisher in [session.declare_publisher(key) for key in keys]:
            publisher.undeclare()


def main() -> None:
    """Go on until killed; the argument is the router's endpoint."""
    for _ in range(ASKING):
        session = open_client(sys.argv[1])
        threading.Thread(target=list_publishers, args=(session,), daemon=True).start()
    for name in range(DECLARING):
        session = open_client(sys.argv[1])
        threading.Thread(target=declare, args=(session, name), daemon=True).start()
    threading.Event().wait()


if __name__ == "__main__":
    main()
