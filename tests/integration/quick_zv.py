"""``zv`` whose health and lines come ten times as often, and whose viewer has less patience."""

from __future__ import annotations

import sys

from common import serving
from services.cli.main import main
from services.up import service

if __name__ == "__main__":
    serving.HEALTH_PERIOD_S /= 10
    service.LINE_PERIOD_S /= 10
    if "view" in sys.argv:
        from services.viewer import compatible, live

        compatible.STALLED_S /= 10
        live.STALLED_S /= 10
    main()
