"""Render docs/images/edges/*.png, and write the table of localisation into docs/edges.md.

The picture is a part of the synthetic camera's scene. Every step is what ``zv edge`` publishes of
it. Run it from the top of the repository:

    make figures
"""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.support.pictures.analytic_edges import Step, judge
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import SourceOpener
from zv.edge.detectors.available import DETECTORS
from zv.edge.detectors.canny import Canny
from zv.edge.detectors.rendering import as_hue

ROOT = Path(__file__).parents[2]
FOLDER = Path(__file__).parent / "edges"
PAGE = ROOT / "docs" / "edges.md"
SHOWN_FRAME = 180
PART = (slice(200, 440), slice(270, 590))
"""Rows and columns of the scene that are shown."""
DETAIL = (slice(106, 130), slice(28, 60))
"""Rows and columns of that part that are shown enlarged: a wheel."""
ENLARGED = 10
GAP = 8
PAPER = 255
GRAY = (225, 225, 225)
BLUE = (230, 120, 20)
LEGEND_SIDE = 161
COLUMNS = 4
LABEL_HEIGHT = 22
INK = (40, 40, 40)
ANGLES = tuple(3.7 + 15 * turn for turn in range(24))
OFFSETS = (0.0, 0.25, 0.5)
NOISES = (0.0, 10.0, 20.0)

Picture = NDArray[np.uint8]


def main() -> None:
    """Render the pictures, measure, and write the files."""
    FOLDER.mkdir(exist_ok=True)
    colour = scene()
    gray = np.asarray(cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY), np.uint8)
    found = Canny().detect(gray)
    steps = {"input": lambda: gray, **found.stages, "final": lambda: found.edges}
    for number, (name, make) in enumerate(steps.items()):
        write(f"canny_{number}_{name}.png", with_detail(in_colour(make())))
    write("hues.png", legend())
    tiles = []
    for name, kind in DETECTORS.items():
        picture = colour if kind.wants == "bgr" else gray
        tiles.append(labelled(in_colour(255 - kind().detect(picture).edges), name))
    write("detectors.png", montage(tiles))
    between("localisation", table())


def scene() -> Picture:
    """Return the part of the synthetic scene, (240, 320, 3) uint8."""
    settings = CameraSettings()
    source = SourceOpener()(settings, lambda: settings)
    for _ in range(SHOWN_FRAME + 1):
        picture = source.read()
    assert picture is not None
    assert picture.pixels is not None
    return np.ascontiguousarray(picture.pixels[PART], np.uint8)


def in_colour(picture: Picture) -> Picture:
    """Return a picture, grey or not, with three channels."""
    if picture.ndim == 3:
        return picture
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR), np.uint8)


def with_detail(picture: Picture) -> Picture:
    """Return a picture with a frame around the detail, and the detail enlarged beside it."""
    near = cv2.resize(
        picture[DETAIL], None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_NEAREST
    )
    marked = picture.copy()
    rows, columns = DETAIL
    corners = (columns.start - 1, rows.start - 1), (columns.stop, rows.stop)
    cv2.rectangle(marked, *corners, BLUE, 1)
    gap = np.full((picture.shape[0], GAP, 3), PAPER, np.uint8)
    return np.hstack([marked, gap, np.asarray(near, np.uint8)])


def legend() -> Picture:
    """Return the hue of each direction, as a disc whose middle is the pixel."""
    place = np.arange(LEGEND_SIDE) - LEGEND_SIDE // 2
    x, y = np.meshgrid(place, place)
    radius = np.hypot(x, y)
    ring = (radius > LEGEND_SIDE * 0.2) & (radius < LEGEND_SIDE * 0.48)
    disc = as_hue(x, y, np.full(x.shape, 255, np.uint8))
    return np.where(ring[..., np.newaxis], disc, np.uint8(PAPER))


def labelled(picture: Picture, text: str) -> Picture:
    """Return a picture with a text above it."""
    label = np.full((LABEL_HEIGHT, picture.shape[1], 3), PAPER, np.uint8)
    cv2.putText(label, text, (4, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.55, INK, 1, cv2.LINE_AA)
    return np.vstack([label, picture])


def montage(tiles: list[Picture]) -> Picture:
    """Return pictures of one size in rows."""
    tiles = [
        cv2.copyMakeBorder(each, 0, 0, GAP, GAP, cv2.BORDER_CONSTANT, value=GRAY) for each in tiles
    ]
    empty = np.full_like(tiles[0], GRAY[0])
    filled = tiles + [empty] * (-len(tiles) % COLUMNS)
    rows = [np.hstack(filled[at : at + COLUMNS]) for at in range(0, len(filled), COLUMNS)]
    return np.vstack(rows)


def table() -> str:
    """Return the table of errors on steps of known position, in Markdown."""
    lines = [
        "| detector | noise | error, pixels | bias, pixels | false, per picture | missed |",
        "|---|---|---|---|---|---|",
    ]
    lines += [localisation_row(name, noise) for name in DETECTORS for noise in NOISES]
    return "\n".join(lines)


def localisation_row(name: str, noise: float) -> str:
    """Return the row of a detector at a noise of so many grey levels."""
    kind = DETECTORS[name]
    judged = []
    for number, angle in enumerate(ANGLES):
        for offset in OFFSETS:
            step = Step(angle, offset)
            picture = step.picture(noise, seed=number)
            shown = in_colour(picture) if kind.wants == "bgr" else picture
            judged.append(judge(step, kind().detect(shown).edges))
    errors = np.concatenate([each.errors for each in judged])
    rms = np.sqrt(np.mean(errors**2)) if errors.size else np.nan
    bias = errors.mean() if errors.size else np.nan
    false = np.mean([each.false for each in judged])
    missed = np.mean([each.missed for each in judged])
    return f"| `{name}` | {noise:g} | {rms:.2f} | {bias:+.2f} | {false:.1f} | {missed:.0%} |"


def between(name: str, text: str) -> None:
    """Replace the text between the two marks of a name in docs/edges.md."""
    page = PAGE.read_text()
    marks = rf"(<!-- {name} -->\n).*?(<!-- end of {name} -->)"
    PAGE.write_text(re.sub(marks, lambda found: f"{found[1]}{text}\n{found[2]}", page, flags=re.S))


def write(name: str, picture: Picture) -> None:
    """Write a PNG as small as it gets."""
    cv2.imwrite(str(FOLDER / name), picture, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    cv2.setNumThreads(1)
    main()
