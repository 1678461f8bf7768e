"""A service of this system that decodes each frame: ENDPOINT N TRANSPORT, or a client of centroids.

With ``centroid`` as TRANSPORT it measures the tracker's results instead.
"""

import sys

from benchmarks.peers.programs.measuring import Ages
from zenoh_vision import Connection, Node, latest


def main() -> None:
    """Measure."""
    endpoint, wanted, transport = sys.argv[1:]
    ages = Ages(int(wanted))
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
