"""Writes how costs grow: a table, a plot and a sentence for each kind of work."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks import page
from benchmarks.growth.fit import LIMIT, exponent, grows_faster
from benchmarks.growth.measuring import MEDIUM, RATE_HZ, SIZES, SMALL, Point

TEMPLATE = Path(__file__).with_name("performance.md.template")
COLOURS = {"camera": "#1a7f5a", "router": "#5577aa", "subscriber": "#b5651d", "viewer": "#8855aa"}
REFERENCE_COLOUR = "#888888"
AGES = {"p50": "#333333", "p99": "#c03030"}
LEAST_SHARE = 0.95
"""Of the frames, that must have been decoded: what was not done costs nothing."""
WIDTH, HEIGHT, LEFT, TOP = 330, 250, 60, 40
"""Of the area of a diagram, and its place in its half of the plot."""
LINE = 14
"""Between the names of two lines that end at the same place."""
HALF, HIGH = LEFT + WIDTH + 90, TOP + HEIGHT + 50


@dataclass(frozen=True, slots=True)
class Growth:
    """One kind of work, and what was measured while there was more of it.

    Attributes:
        name: Of its plot.
        title: Of its section.
        work: What there is more and more of.
        unit: Of the CPU time.
        points: By ascending work.
    """

    name: str
    title: str
    work: str
    unit: str
    points: Sequence[Point]

    @property
    def works(self) -> list[int]:
        """The amounts of work."""
        return [point.work for point in self.points]

    def costs(self, kind: str) -> list[float]:
        """Return the costs of one kind of process."""
        return [point.cpu_ms[kind] for point in self.points]

    @property
    def kinds(self) -> list[str]:
        """The kinds of processes."""
        return sorted(self.points[0].cpu_ms)

    def label(self, work: int) -> str:
        """Return an amount of work for people: pixels as the size of the frame."""
        if self.work != "pixels":
            return str(work)
        return next((f"{w}x{h}" for w, h in SIZES if w * h == work), str(work))


def growths(
    cameras: Sequence[Point], subscribers: Sequence[Point], pixels: Sequence[Point]
) -> list[Growth]:
    """Return the three kinds of work."""
    small, medium = ("x".join(map(str, size)) for size in (SMALL, MEDIUM))
    rate = f"{RATE_HZ:g} Hz"
    return [
        Growth("cameras", f"Cameras of {small} at {rate}", "cameras", "ms a second", cameras),
        Growth(
            "subscribers",
            f"Subscribers of one camera of {medium} at {rate}",
            "subscribers",
            "ms a second",
            subscribers,
        ),
        Growth("pixels", f"Frame size, at {rate}", "pixels", "ms a frame", pixels),
    ]


def table(growth: Growth) -> str:
    """Return the points as a Markdown table, with the exponents in its last line."""
    head = [growth.work if growth.work != "pixels" else "frame"]
    head += [f"{kind}, {growth.unit}" for kind in growth.kinds]
    lines = [[*head, "p50, ms", "p99, ms", "decoded"], ["---"] * (len(head) + 3)]
    for point in growth.points:
        costs = [f"{point.cpu_ms[kind]:.2f}" for kind in growth.kinds]
        ages = [f"{point.p50_ms:.1f}", f"{point.p99_ms:.1f}", f"{100 * point.share:.0f} %"]
        lines.append([growth.label(point.work), *costs, *ages])
    found = [f"{exponent(growth.works, growth.costs(kind)):.2f}" for kind in growth.kinds]
    lines.append(["exponent", *found, "", "", ""])
    return "\n".join(f"| {' | '.join(cells)} |".replace("  ", " ") for cells in lines)


def verdict(growth: Growth) -> str:
    """Return in a sentence what grows faster than the work, and the cost for one unit of it."""
    lost = [point for point in growth.points if point.share < LEAST_SHARE]
    faster = [kind for kind in growth.kinds if grows_faster(growth.works, growth.costs(kind))]
    if lost:
        some = ", ".join(
            f"{100 * point.share:.0f} % at {growth.label(point.work)}" for point in lost
        )
        stated = f"Not judged, as the machine was too busy: of the frames, {some} were decoded."
    elif faster:
        stated = f"**Faster than the {growth.work} grows the cost of: {', '.join(faster)}.**"
    else:
        stated = f"No cost grows faster than the {growth.work} (no exponent above {LIMIT})."
    if growth.work == "pixels":
        scale, one = 1e6, "a megapixel"
    else:
        scale, one = 1, f"one of the {growth.work}"
    first, last = growth.points[0], growth.points[-1]
    each = [
        f"{kind} {scale * first.cpu_ms[kind] / first.work:.2f} and "
        f"{scale * last.cpu_ms[kind] / last.work:.2f}"
        for kind in growth.kinds
    ]
    ends = f"{growth.label(first.work)} and at {growth.label(last.work)}"
    return f"{stated} For {one}, at {ends}, {growth.unit}: {', '.join(each)}."


def plot(growth: Growth) -> str:
    """Return an SVG with the costs on the left, the ages on the right; all axes are logarithmic."""
    works = growth.works
    costs = {kind: growth.costs(kind) for kind in growth.kinds}
    ages = {
        "p50": [point.p50_ms for point in growth.points],
        "p99": [point.p99_ms for point in growth.points],
    }
    steepest = max(growth.kinds, key=lambda kind: costs[kind][0])
    reference = [costs[steepest][0] * work / works[0] for work in works]
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * HALF} {HIGH}" '
            'font-family="sans-serif" font-size="12">',
            f'<rect width="{2 * HALF}" height="{HIGH}" fill="#fff"/>',
            *_diagram(growth, f"CPU, {growth.unit}", costs, COLOURS, 0, reference),
            *_diagram(growth, "age of decoded frames, ms", ages, AGES, HALF),
            "</svg>",
            "",
        ]
    )


def _diagram(
    growth: Growth,
    title: str,
    lines: dict[str, list[float]],
    colours: dict[str, str],
    left: int,
    reference: Sequence[float] | None = None,
) -> list[str]:
    values = [value for line in [*lines.values(), reference or []] for value in line]
    low, high = _decades(values)
    works = growth.works
    across = _scale(works[0], works[-1], left + LEFT, left + LEFT + WIDTH)
    down = _scale(low, high, TOP + HEIGHT, TOP)
    parts = [f'<text x="{left + LEFT}" y="18" font-weight="bold">{title}</text>']
    for decade in range(round(math.log10(high / low)) + 1):
        value = low * 10**decade
        parts += [
            f'<path d="M{left + LEFT} {down(value):.1f}h{WIDTH}" stroke="#ddd"/>',
            f'<text x="{left + LEFT - 6}" y="{down(value) + 4:.1f}" text-anchor="end">'
            f"{value:g}</text>",
        ]
    for number, work in enumerate(works):
        lower = 10 * (number % 2) if growth.work == "pixels" else 0  # they are wide
        parts.append(
            f'<text x="{across(work):.1f}" y="{TOP + HEIGHT + 16 + lower}" font-size="11" '
            f'text-anchor="middle">{growth.label(work)}</text>'
        )
    name = "frame" if growth.work == "pixels" else growth.work
    middle = left + LEFT + WIDTH / 2
    parts.append(f'<text x="{middle}" y="{TOP + HEIGHT + 38}" text-anchor="middle">{name}</text>')
    ends: dict[str, float] = {}
    if reference is not None:
        path = _path(works, reference, across, down)
        parts.append(
            f'<path d="{path}" stroke="{REFERENCE_COLOUR}" stroke-dasharray="5 4" fill="none"/>'
        )
        ends["as the work"] = down(reference[-1])
    for kind, line in lines.items():
        colour = colours[kind]
        parts.append(
            f'<path d="{_path(works, line, across, down)}" stroke="{colour}" stroke-width="2" '
            'fill="none"/>'
        )
        parts += [
            f'<circle cx="{across(work):.1f}" cy="{down(value):.1f}" r="3" fill="{colour}"/>'
            for work, value in zip(works, line, strict=True)
        ]
        ends[kind] = down(line[-1])
    return parts + _names(across(works[-1]), ends, colours)


def _names(x: float, wanted: dict[str, float], colours: dict[str, str]) -> list[str]:
    """Return the names of lines beside their ends, moved down where they would overlap."""
    parts, least = [], 0.0
    for text, y in sorted(wanted.items(), key=lambda item: item[1]):
        least = max(y + 4, least)
        colour = colours.get(text, REFERENCE_COLOUR)
        parts.append(f'<text x="{x + 7:.1f}" y="{least:.1f}" fill="{colour}">{text}</text>')
        least += LINE
    return parts


def _path(
    works: Sequence[float],
    values: Sequence[float],
    across: Callable[[float], float],
    down: Callable[[float], float],
) -> str:
    points = (
        f"{across(work):.1f} {down(value):.1f}" for work, value in zip(works, values, strict=True)
    )
    return "M" + "L".join(points)


def _decades(values: Sequence[float]) -> tuple[float, float]:
    """Return the powers of ten around all values."""
    low = math.floor(math.log10(min(values)))
    high = math.ceil(math.log10(max(values)))
    return 10.0**low, 10.0 ** max(high, low + 1)


def _scale(low: float, high: float, start: float, end: float) -> Callable[[float], float]:
    """Return what maps a value to its place on a logarithmic axis."""
    return lambda value: start + (end - start) * math.log(value / low) / math.log(high / low)


def write_page(found: Sequence[Growth]) -> None:
    """Write the part on growth of docs/performance.md, and its plots."""
    sections = []
    for growth in found:
        address = page.write_plot(growth.name, plot(growth))
        sections.append(
            f"### {growth.title}\n\n{verdict(growth)}\n\n{table(growth)}\n\n"
            f"![Costs and ages by number of {growth.work}]({address})\n"
        )
    text = TEMPLATE.read_text().format(machine=page.machine(), sections="\n".join(sections))
    page.write_part("growth", text)
