"""A node that needs 100 ms for a frame: python slow_consumer.py ENDPOINT NAMESPACE."""

import sys
import time

from zenoh_vision.node.node import Node
from zenoh_vision.transport.connection import Connection

with Node("slow", connection=Connection(sys.argv[1], sys.argv[2])) as node:
    for _ in node.frames("image/compressed", want="gray"):
        time.sleep(0.1)
