"""``zv calibrate plane``: find the homography from a camera's pixels to a plane in the world."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault, CameraModel, Points
from zenoh_vision.calibration.plane import DegeneratePairs, PlaneFit, fit_plane
from zenoh_vision.calibration.ros_yaml import read_calibration, write_calibration
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, SourceError
from zenoh_vision.transport.connection import Connection
from zv.tools.calibrate.board import Board, BoardView
from zv.tools.calibrate.options import PAIR_WORDS, PlaneOptions, pair_of
from zv.tools.calibrate.pictures import board_of, from_stream, read_gray
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession

MAX_BYTES: Final = 1 << 20
MAX_PAIRS: Final = 1000


@dataclass(frozen=True)
class Pairs:
    """Pixels and their places in the world.

    Attributes:
        pixels: (n, 2), distorted as the picture shows them.
        world: (n, 2).
        size: Width and height of the picture; None if it is that of the calibration.
    """

    pixels: Points
    world: Points
    size: tuple[int, int] | None = None


def run(options: PlaneOptions, connection: Connection, output: Output) -> None:
    """Find the homography and write it into the calibration file.

    Raises:
        ConfigurationError: The calibration or the pairs are wrong, or there are two kinds of
            pairs.
        SourceError: A file cannot be opened or written.
        ExpectationNotMet: The pairs do not determine a plane, or there is no board. Nothing is
            written.
    """
    calibration = _calibration(options)
    pairs = _pairs(options, connection, output)
    try:
        if pairs.size is not None:
            calibration = calibration.scaled(*pairs.size)
    except CalibrationFault as fault:
        raise ConfigurationError(f"{options.calibration}: {fault}") from None
    ideal = calibration.camera.undistorted(pairs.pixels)
    lens = calibration.camera
    for (x, y), place in zip(pairs.pixels, ideal, strict=True):
        if not (-0.5 <= x <= lens.width - 0.5 and -0.5 <= y <= lens.height - 0.5):
            raise ConfigurationError(
                f"pixel {x:g},{y:g} is outside of the picture; allowed: 0,0 to "
                f"{lens.width - 1},{lens.height - 1}"
            )
        if not np.isfinite(place).all():
            raise ConfigurationError(
                f"pixel {x:g},{y:g} is outside of what the lens of {options.calibration} can show"
            )
    try:
        fit = fit_plane(ideal, pairs.world)
    except DegeneratePairs as error:
        raise ExpectationNotMet(str(error)) from None
    if options.max_error is not None and fit.rms > options.max_error:
        raise ExpectationNotMet(
            f"the error is {fit.rms:.4g}, at most {options.max_error:g} is allowed; the worst pair "
            f"is {_worst(fit, pairs)}"
        )
    path = options.output or options.calibration
    write_calibration(replace(calibration, plane=fit.plane), path)
    _report(path, fit, pairs, output)


def _calibration(options: PlaneOptions) -> Calibration:
    if options.no_lens is None:
        return read_calibration(options.calibration)
    width, height = map(int, options.no_lens.split("x"))
    if Path(options.calibration).exists():
        raise ConfigurationError(
            f"{options.calibration} exists, and --no-lens would replace its lens; leave it out, or "
            "give another FILE"
        )
    k = (float(width), 0.0, (width - 1) / 2, 0.0, float(width), (height - 1) / 2, 0.0, 0.0, 1.0)
    try:
        return Calibration(CameraModel(width, height, k), options.camera)
    except CalibrationFault as fault:
        raise ConfigurationError(f"--no-lens: {fault}") from None


def _pairs(options: PlaneOptions, connection: Connection, output: Output) -> Pairs:
    kinds = {
        "--pair": bool(options.pair),
        "--pairs": options.pairs is not None,
        "a board (--size, --square)": options.size is not None or options.image is not None,
    }
    given = [name for name, is_given in kinds.items() if is_given]
    if len(given) != 1:
        said = " and ".join(given) or "no pairs"
        raise ConfigurationError(f"{said} given; allowed: one of {', '.join(kinds)}")
    if options.pair:
        return _of_texts(options.pair)
    if options.pairs is not None:
        return _of_texts(read_pairs(options.pairs))
    board = board_of(options)
    view = _view(board, options, connection)
    output.note(_axes(view))
    return Pairs(view.pixels, view.points, (view.width, view.height))


def _axes(view: BoardView) -> str:
    """Return in words where the picture shows the board's origin and the ends of its axes."""
    origin = int(np.abs(view.points).sum(axis=1).argmin())
    ends = [origin]
    for axis in (0, 1):
        row = np.flatnonzero(view.points[:, 1 - axis] == view.points[origin, 1 - axis])
        ends.append(int(row[view.points[row, axis].argmax()]))
    first, along_x, along_y = (f"{x:.0f},{y:.0f}" for x, y in view.pixels[ends])
    return (
        f"board with {len(view.points)} corners; its first inner corner, near {first}, is the "
        f"origin; X runs towards {along_x}, Y towards {along_y}"
    )


def _view(board: Board, options: PlaneOptions, connection: Connection) -> BoardView:
    words = f"no {board.kind} of {board.columns}x{board.rows}"
    if options.image is not None:
        view = board.find(read_gray(options.image))
        if view is None:
            raise ExpectationNotMet(f"{words} found in {options.image}")
        return view
    searched = 0
    with ToolSession(connection) as session:
        for gray in from_stream(session, options.camera, options.for_):
            if (view := board.find(gray)) is not None:
                return view
            searched += 1
    raise ExpectationNotMet(f"{words} found in {searched} pictures of {options.camera}")


def read_pairs(path: str) -> tuple[str, ...]:
    """Read a file of pairs, ``x,y=X,Y`` a line.

    Raises:
        SourceError: It cannot be opened.
        ConfigurationError: A line is not a pair; names file, line and what is allowed.
    """
    try:
        with Path(path).open("rb") as file:
            text = file.read(MAX_BYTES + 1).decode("utf-8-sig")
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise ConfigurationError(f"{path}: not a text; allowed: {PAIR_WORDS}, one a line") from None
    found = []
    for number, line in enumerate(text.splitlines(), 1):
        pair = line.partition("#")[0].strip()
        if not pair:
            continue
        try:
            pair_of(pair)
        except ValueError:
            raise ConfigurationError(
                f"{path}: line {number}: {pair[:80]!r}; allowed: {PAIR_WORDS}"
            ) from None
        found.append(pair)
    if len(found) > MAX_PAIRS:
        raise ConfigurationError(f"{path}: {len(found)} pairs; allowed: at most {MAX_PAIRS}")
    return tuple(found)


def _of_texts(texts: tuple[str, ...]) -> Pairs:
    numbers = np.array([pair_of(text) for text in texts], np.float64).reshape(-1, 4)
    return Pairs(numbers[:, :2], numbers[:, 2:])


def _worst(fit: PlaneFit, pairs: Pairs) -> str:
    index = int(np.argmax(fit.residuals))
    x, y = pairs.pixels[index]
    return f"{x:g},{y:g} with {fit.residuals[index]:.4g}"


def _report(path: str, fit: PlaneFit, pairs: Pairs, output: Output) -> None:
    count = len(pairs.pixels)
    lines = [f"{path}: plane of {count} pairs"]
    if count == 4:
        lines.append("four pairs are met exactly and check nothing: a fifth shows the error")
    else:
        lines.append(f"error {fit.rms:.4g} (rms, world units); worst pair {_worst(fit, pairs)}")
    lines.append(
        f"a standard deviation of one pixel in the pairs makes {fit.per_pixel:.4g} on the plane"
    )
    output.result(
        {
            "file": path,
            "pairs": count,
            "rms": fit.rms,
            "residuals": fit.residuals.tolist(),
            "per_pixel": fit.per_pixel,
            "plane": fit.plane.h,
        },
        *lines,
    )
