"""Writes what the comparison found: a table, plots, and the page that explains them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import escape

from benchmarks import page
from benchmarks.peers.comparison import FLOOR, QUALITIES, ROUNDS, SIZES, Row

HEAD = """| {size} | p50, ms | p99, ms | CPU, ms a frame | router, ms a frame | memory, MB |
|---|---|---|---|---|---|"""

TEMPLATE = Path(__file__).with_name("performance.md.template")


def table(rows: Sequence[Row], size: tuple[int, int]) -> str:
    """Return the rows of one size as a Markdown table, the fastest first."""
    lines = [HEAD.format(size=f"{size[0]}x{size[1]}")]
    for row in ordered(rows, size):
        name = f"**{label(row)}**" if row.system.ours else label(row)
        cells = [name, f"{row.p50_ms:.2f}", f"{row.p99_ms:.2f}", f"{row.cpu_ms:.2f}"]
        cells += ["", ""] if row.system is FLOOR else [between(row), f"{row.memory_mb:.0f}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def between(row: Row) -> str:
    """Return what the router costs; nothing where there is none."""
    return f"{row.between_ms:.2f}" if row.between_ms else ""


def label(row: Row) -> str:
    """Return what a row measures."""
    quality = "" if row.quality is None else f", quality {row.quality}"
    return f"{row.system.name}{quality}"


def ordered(rows: Sequence[Row], size: tuple[int, int]) -> list[Row]:
    """Return the rows of a size by quality, those without last; within them the fastest first."""
    groups = [*QUALITIES, None]
    return sorted(
        (row for row in rows if row.size == size),
        key=lambda row: (row.system.result, groups.index(row.quality), row.p50_ms),
    )


def plot(rows: Sequence[Row], size: tuple[int, int]) -> str:
    """Return an SVG with a bar up to the p50 of each row, and a line on to its p99."""
    shown = ordered(rows, size)
    left, width, height, high = 330, 420, 26, 26 * len(shown) + 46
    most = max((row.p99_ms for row in shown), default=1.0)
    scale = width / most
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {left + width + 90} {high}" '
        'font-family="sans-serif" font-size="13">',
        f'<rect width="{left + width + 90}" height="{high}" fill="#fff"/>',
        f'<text x="{left}" y="18">{size[0]}x{size[1]}: age in ms, bar p50, line p99</text>',
    ]
    for number, row in enumerate(shown):
        y = 30 + number * height
        middle, end = y + height / 2 - 2, left + row.p99_ms * scale
        colour = "#1a7f5a" if row.system.ours else "#999" if row.system is FLOOR else "#5577aa"
        parts += [
            f'<text x="{left - 8}" y="{middle + 4}" text-anchor="end">{escape(label(row))}</text>',
            f'<rect x="{left}" y="{y + 3}" width="{row.p50_ms * scale:.1f}" '
            f'height="{height - 10}" fill="{colour}"/>',
            f'<path d="M{left} {middle}H{end:.1f}m0 -5v10" stroke="#333" fill="none"/>',
            f'<text x="{end + 6:.1f}" y="{middle + 4}">{row.p50_ms:.1f} / {row.p99_ms:.1f}</text>',
        ]
    return "\n".join([*parts, "</svg>", ""])


def write_page(rows: Sequence[Row]) -> None:
    """Write the comparison's part of docs/performance.md, and its plots."""
    sections = []
    for size in SIZES:
        name = f"{size[0]}x{size[1]}"
        picture = f"![Ages of frames of {name}]({page.write_plot(name, plot(rows, size))})"
        sections.append(f"## {name}\n\n{table(rows, size)}\n\n{picture}\n")
    text = TEMPLATE.read_text().format(
        machine=page.machine(), rounds=ROUNDS, sections="\n".join(sections)
    )
    page.write_part("peers", text)
