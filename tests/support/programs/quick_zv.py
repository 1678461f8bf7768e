"""``zv`` that says and checks all ten times as often, and waits less for others."""

from __future__ import annotations

import sys

from zenoh_vision.node import announcement
from zenoh_vision.transport import access
from zv.cli import main as command_line
from zv.launcher import starting, supervisor


def main() -> None:
    """Change the periods, and be ``zv``."""
    announcement.PERIOD_S /= 10
    access.CHECK_S /= 10
    access.CHANGED_S /= 10
    starting.LINES_PERIOD_S /= 10
    supervisor.ANNOUNCED_S /= 10
    if "view" in sys.argv:
        from zv.viewer.http import connections

        connections.LEFT_S /= 10
    if "topic" in sys.argv:
        from zv.tools.topic import echo, measure

        echo.QUERY_AFTER_S /= 10
        measure.PERIOD_S /= 10
    if "top" in sys.argv:
        from zv.tools.top import command

        command.PERIOD_S /= 10
        command.TWO_REPORTS_S /= 10
    command_line.main()


if __name__ == "__main__":
    main()
