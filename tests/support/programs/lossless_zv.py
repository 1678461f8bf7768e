"""``zv`` whose frames wait for a busy machine's network, for tests that count every one of them."""

from __future__ import annotations

import zenoh

from zenoh_vision.transport import publisher
from zv.cli import main as command_line


def main() -> None:
    """Change how frames are delivered, and be ``zv``."""
    publisher.FRAME_DELIVERY = (zenoh.CongestionControl.BLOCK, zenoh.Priority.DATA)
    command_line.main()


if __name__ == "__main__":
    main()
