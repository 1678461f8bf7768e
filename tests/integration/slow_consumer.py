"""A node that needs 100 ms for a frame: python slow_consumer.py ENDPOINT NAMESPACE."""

import sys
import time

from common.connection import Connection
from common.node import Node

with Node("slow", connection=Connection(sys.argv[1], sys.argv[2])) as node:
    for _ in node.frames("image", want="gray"):
        time.sleep(0.1)
