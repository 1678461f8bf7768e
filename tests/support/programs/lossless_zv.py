"""``zv`` whose frames wait for a busy machine's network, for tests that count every one of them."""

from __future__ import annotations

import zenoh

from zenoh_vision.transport import publisher, zenoh_config
from zv.cli import main as command_line


def main() -> None:
    """Change how frames are delivered, and how long a router waits; then be ``zv``."""
    publisher.FRAME_DELIVERY = (zenoh.CongestionControl.BLOCK, zenoh.Priority.DATA)
    zenoh_config.WAIT_BEFORE_CLOSE_US = 30_000_000
    command_line.main()


if __name__ == "__main__":
    main()
