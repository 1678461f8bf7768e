"""``zv calibrate camera``: find the lens of a camera from pictures of a board."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.ros_yaml import write_calibration
from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.transport.connection import Connection
from zv.tools.calibrate.board import Board, BoardView, Gray
from zv.tools.calibrate.coverage import PARTS, Pose, missing, pose_of
from zv.tools.calibrate.lens import LensFit, PoorViews, fit_lens
from zv.tools.calibrate.options import CameraOptions
from zv.tools.calibrate.pictures import board_of, from_folder, from_stream
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession

STILL_SHARE: Final = 0.004
"""Share of the picture's width. A board that moved by more since the last picture is blurred."""

COUNTED: Final = {
    "chessboard": "the inner corners of a chessboard",
    "charuco": "the squares of a charuco, whose markers must be of --dictionary",
}
"""What may be wrong with the options if no picture shows the board."""

MOST_VIEWS: Final = 40
MAX_FOCAL_SIGMA: Final = 0.01


@dataclass
class Collection:
    """The views that a calibration is made from.

    Attributes:
        views: The views taken; ``poses`` and ``names`` have an entry for each.
        searched: Number of pictures in which the board was looked for.
    """

    board: Board
    views: list[BoardView] = field(default_factory=list)
    poses: list[Pose] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    searched: int = 0

    def consider(self, name: str, gray: Gray) -> str:
        """Add the view in a picture if it is new enough; return the outcome as text."""
        self.searched += 1
        view = self.board.find(gray)
        return f"{name}: no board found" if view is None else self.take(name, view)

    def take(self, name: str, view: BoardView, before: BoardView | None = None) -> str:
        """Add a view if it is new enough; return the outcome as text.

        ``before``: The view in the previous picture of a stream; a moved board is not taken.
        """
        if self.views and (view.width, view.height) != (self.views[0].width, self.views[0].height):
            first = self.views[0]
            return f"{name}: {view.width}x{view.height}, not {first.width}x{first.height}: left out"
        if before is not None and not _still(view, before):
            return f"{name}: the board moves: hold it still"
        pose = pose_of(view)
        if any(pose.is_like(other) for other in self.poses):
            return f"{name}: the board is as in another picture: left out"
        self.views.append(view)
        self.poses.append(pose)
        self.names.append(name)
        lacking = missing(self.poses)
        rest = f"; missing: {'; '.join(lacking)}" if lacking else "; complete"
        return f"{name}: {describe(pose, view)}{rest}"


def describe(pose: Pose, view: BoardView) -> str:
    """Return where the board is and how it lies, in words."""
    row, column = min(2, int(pose.y * 3)), min(2, int(pose.x * 3))
    return (
        f"{len(view.points)} corners, {PARTS[row][column]}, {pose.share:.0%} of the picture, "
        f"turned {pose.turned_deg:+.0f} and leaned {pose.leaned_deg:+.0f} degrees"
    )


def run(options: CameraOptions, connection: Connection, output: Output) -> None:
    """Collect views, find the lens and write the file.

    Raises:
        ConfigurationError: The board is not described.
        SourceError: The folder cannot be read, or the file cannot be written.
        ExpectationNotMet: The pictures are too poor; says what is missing. Nothing is written.
    """
    collection = Collection(board_of(options))
    if options.images is None:
        with ToolSession(connection) as session:
            collect_from_stream(collection, session, options, output)
    else:
        for name, gray in from_folder(options.images, output.note):
            output.note(collection.consider(name, gray))
    fit = checked_fit(collection, options)
    path = options.output or f"{options.camera}.yaml"
    write_calibration(Calibration(fit.camera, options.camera), path)
    report(path, fit, collection, output)


def collect_from_stream(
    collection: Collection, session: ToolSession, options: CameraOptions, output: Output
) -> None:
    """Take views from a stream until they are complete, the time is over or told to stop."""
    before: BoardView | None = None
    said = ""
    for number, gray in enumerate(from_stream(session, options.camera, options.for_)):
        collection.searched += 1
        view = collection.board.find(gray)
        if view is not None and before is not None:
            taken = len(collection.views)
            words = collection.take(f"picture {number}", view, before)
            about = words.partition(": ")[2]
            if len(collection.views) > taken or about != said:  # do not repeat the same text
                said = about
                output.note(words)
        before = view
        if len(collection.views) >= MOST_VIEWS or (
            collection.views and not missing(collection.poses)
        ):
            return


def checked_fit(collection: Collection, options: CameraOptions) -> LensFit:
    """Return the lens that the views determine.

    Raises:
        ExpectationNotMet: They are too poor; says what is missing.
    """
    board = collection.board
    if not collection.views:
        raise ExpectationNotMet(
            f"no {board.kind} of {board.columns}x{board.rows} found in {collection.searched} "
            f"pictures; --size counts {COUNTED[board.kind]}"
        )
    lacking = missing(collection.poses)
    if lacking:
        raise ExpectationNotMet(
            f"{len(collection.views)} pictures are not enough; missing: {'; '.join(lacking)}"
        )
    try:
        fit = fit_lens(collection.views, options.model)
    except PoorViews as error:
        raise ExpectationNotMet(f"{error}; add pictures with the board nearer and tilted") from None
    worst = collection.names[int(np.argmax(fit.errors))]
    if fit.rms > options.max_error:
        raise ExpectationNotMet(
            f"the reprojection error is {fit.rms:.2f} pixels, at most {options.max_error:g} are "
            f"allowed; the worst picture is {worst} with {fit.errors.max():.2f}: is the board "
            "flat, were the pictures sharp, does the model fit the lens?"
        )
    if fit.focal_sigma is not None and fit.focal_sigma > MAX_FOCAL_SIGMA:
        raise ExpectationNotMet(
            f"the focal length is known to {fit.focal_sigma:.1%} only, "
            f"{MAX_FOCAL_SIGMA:.0%} are allowed; add pictures with the board nearer and tilted"
        )
    return fit


def report(path: str, fit: LensFit, collection: Collection, output: Output) -> None:
    """Print the calibration that was found."""
    camera = fit.camera
    sigma = "" if fit.focal_sigma is None else f" (+-{fit.focal_sigma:.2%})"
    worst = int(np.argmax(fit.errors))
    output.result(
        {
            "file": path,
            "pictures": len(collection.views),
            "rms_px": round(fit.rms, 4),
            "worst_px": round(float(fit.errors[worst]), 4),
            "worst_picture": collection.names[worst],
            "focal_sigma": fit.focal_sigma,
            "width": camera.width,
            "height": camera.height,
            "distortion_model": camera.distortion_model,
            "k": camera.k,
            "d": camera.d,
        },
        f"{path}: {len(collection.views)} pictures of {camera.width}x{camera.height}",
        f"reprojection error {fit.rms:.3f} pixels, at worst {fit.errors[worst]:.3f} "
        f"({collection.names[worst]})",
        f"focal length {camera.k[0]:.2f}, {camera.k[4]:.2f} pixels{sigma}, "
        f"centre {camera.k[2]:.2f}, {camera.k[5]:.2f}",
        f"{camera.distortion_model} {', '.join(f'{number:.5f}' for number in camera.d)}",
    )


def _still(view: BoardView, before: BoardView) -> bool:
    """Tell whether a board has not moved since the picture before, by the corners in both."""
    places = {
        tuple(point): pixel for point, pixel in zip(before.points, before.pixels, strict=True)
    }
    moves = [
        float(np.abs(pixel - places[tuple(point)]).max())
        for point, pixel in zip(view.points, view.pixels, strict=True)
        if tuple(point) in places
    ]
    return bool(moves) and max(moves) <= STILL_SHARE * view.width
