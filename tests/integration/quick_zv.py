"""``zv`` whose health and whose lines of ``zv up`` come ten times as often, for tests of both."""

from __future__ import annotations

from common import serving
from services.cli.main import main
from services.up import service

if __name__ == "__main__":
    serving.HEALTH_PERIOD_S /= 10
    service.LINE_PERIOD_S /= 10
    main()
