"""``python -m zv`` is ``zv``: ends on Ctrl-C from its first moment, and loads the commands."""

from __future__ import annotations

import os
import signal


def main() -> None:
    """Run ``zv``. Loading takes a tenth of a second, in which Ctrl-C would show a traceback."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _at: os._exit(0))
    from zv.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
