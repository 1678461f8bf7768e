"""``zv`` whose lines of ``zv up`` come ten times as often, for tests of what stands in them."""

from __future__ import annotations

from services.cli.main import main
from services.up import service

if __name__ == "__main__":
    service.LINE_PERIOD_S /= 10
    main()
