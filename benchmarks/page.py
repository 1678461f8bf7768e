"""Writes docs/performance.md, whose parts are measured by different runs."""

from __future__ import annotations

import platform
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "performance.md"
PLOTS = ROOT / "docs" / "images" / "performance"


def write_part(name: str, text: str) -> None:
    """Replace one part of the page, between two comments of its name; the others stay.

    A part that is not there yet is put at the end.
    """
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    part = f"{begin}\n{text.strip()}\n\n{end}"
    page = PAGE.read_text() if PAGE.exists() else ""
    known = re.compile(f"{re.escape(begin)}.*{re.escape(end)}", re.DOTALL)
    found, count = known.subn(lambda _: part, page)
    PAGE.write_text(found if count else f"{page}{part}\n")


def write_plot(name: str, svg: str) -> str:
    """Write a plot, and return its address in the page."""
    PLOTS.mkdir(parents=True, exist_ok=True)
    (PLOTS / f"{name}.svg").write_text(svg)
    return f"images/performance/{name}.svg"


def machine() -> str:
    """Return on what was measured."""
    return f"Measured on {processor()}, Python {platform.python_version()}."


def processor() -> str:
    """Return the number of processors and what they are, as the kernel names them."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return platform.machine()
    names = [line.partition(":")[2].strip() for line in text.splitlines() if "model name" in line]
    return f"{len(names)} processors ({names[0]})" if names else platform.machine()
