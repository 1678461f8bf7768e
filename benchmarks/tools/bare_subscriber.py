"""A minimal subscriber in Python, ENDPOINT KEY: counts samples until SIGTERM."""

from __future__ import annotations

import itertools
import sys
import threading

from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.session import direct, open_session


def main() -> None:
    """Subscribe, count, and say once how to be ended."""
    session = open_session(Connection(connect=sys.argv[1], timeout_s=20))
    count = itertools.count()
    session.declare_subscriber(sys.argv[2], direct(lambda _: next(count)))
    threading.Event().wait()


if __name__ == "__main__":
    main()
