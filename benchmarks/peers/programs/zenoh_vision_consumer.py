"""A service of this system that decodes each frame: ENDPOINT N TRANSPORT, or a client of centroids.

With ``centroid`` as TRANSPORT it measures the tracker's results instead.
"""

import sys

from benchmarks.peers.programs.measuring import WARM_UP, Ages
from zenoh_vision import Connection, Node, latest

LEARNED = 165
"""Frames after which the tracker's background is no longer that of its start: 5.5 s."""


def main() -> None:
    """Measure."""
    endpoint, wanted, transport = sys.argv[1:]
    warm_up = LEARNED if transport == "centroid" else WARM_UP
    ages = Ages(int(wanted), warm_up)
    with Node("bench", connection=Connection(connect=endpoint)) as node:
        if transport == "centroid":
            items = node.messages("centroid", buffering=latest)
        else:
            items = node.frames("image/compressed", want="bgr", transport=transport)
        for item in items:
            if not ages.note(item.header.stamp_ns):
                break


if __name__ == "__main__":
    main()
