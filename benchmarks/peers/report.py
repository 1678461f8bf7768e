"""Writes what the comparison found: a table, plots, and the page that explains them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import escape

from benchmarks import page
from benchmarks.peers.comparison import FLOOR, QUALITIES, ROUNDS, SIZES, Row
from benchmarks.peers.systems import OUR_READING, READING, ROS_RAW, SHARED_MEMORY

HEAD = """| {size} | p50, ms | p99, ms | CPU, ms a frame | router, ms a frame | memory, MB |
|---|---|---|---|---|---|"""

TEMPLATE = Path(__file__).with_name("performance.md.template")


def table(rows: Sequence[Row], size: tuple[int, int]) -> str:
    """Return the rows of one size as a Markdown table, the fastest first, after the reading."""
    lines = [HEAD.format(size=f"{size[0]}x{size[1]}")]
    for row in ordered(rows, size):
        name = f"**{label(row)}**" if row.system.ours else label(row)
        ages = ("", "") if row.system.reads else (f"{row.p50_ms:.2f}", f"{row.p99_ms:.2f}")
        cells = [name, *ages, f"{row.cpu_ms:.2f}"]
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


def without_reading(rows: Sequence[Row], size: tuple[int, int]) -> str:
    """Return what pixels through shared memory cost beside those of ROS, with and without reading.

    Empty if one of them was not measured.
    """
    cpu_ms = {row.system.name: row.cpu_ms for row in rows if row.size == size}
    compared = (SHARED_MEMORY, OUR_READING, ROS_RAW, READING)
    if not all(system.name in cpu_ms for system in compared):
        return ""
    ours, our_reading, theirs, their_reading = (cpu_ms[system.name] for system in compared)
    rest, their_rest = ours - our_reading, theirs - their_reading
    return (
        f"Shared memory costs {ours / theirs:.2f} of the CPU time of ROS 1, raw "
        f"({ours:.2f} of {theirs:.2f} ms a frame). Without the reading of the video it is "
        f"{rest / their_rest:.2f} ({rest:.2f} of {their_rest:.2f} ms)."
    )


def ordered(rows: Sequence[Row], size: tuple[int, int]) -> list[Row]:
    """Return the rows of a size: reading, then by quality, those without last; then by age."""
    groups = [*QUALITIES, None]
    return sorted(
        (row for row in rows if row.size == size),
        key=lambda row: (
            not row.system.reads,
            row.system.result,
            groups.index(row.quality),
            row.p50_ms,
        ),
    )


def plot(rows: Sequence[Row], size: tuple[int, int]) -> str:
    """Return an SVG with a bar up to the p50 of each row, and a line on to its p99."""
    shown = [row for row in ordered(rows, size) if not row.system.reads]
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
        parts = (f"## {name}", table(rows, size), without_reading(rows, size), picture)
        sections.append("\n\n".join(filter(None, parts)) + "\n")
    text = TEMPLATE.read_text().format(
        machine=page.machine(), rounds=ROUNDS, sections="\n".join(sections)
    )
    page.write_part("peers", text)
