"""Cuts out of a source's picture the rectangle that the camera publishes."""

from __future__ import annotations

from dataclasses import replace

from zenoh_vision.errors import ParameterRefused, PayloadError
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.messages import Box, Track
from zv.camera.convert import decoded
from zv.camera.sources.base import Picture


def check_region(box: Box | None, width: int, height: int) -> None:
    """Check that a rectangle is within pictures of a size.

    Raises:
        ParameterRefused: A part of the rectangle is outside.
    """
    if box is not None and (box[0] + box[2] > width or box[1] + box[3] > height):
        raise ParameterRefused(
            f"region = {','.join(map(str, box))} is not within the picture of {width}x{height}",
            f"X + WIDTH at most {width}, Y + HEIGHT at most {height}",
        )


def cropped(picture: Picture, box: Box, flip: str) -> Picture:
    """Return the part of a picture, and of its ground truth, that is in a rectangle.

    A JPEG is decoded. Planes stay planes if all numbers of the rectangle are even, since they have
    one value of chroma for 2x2 pixels.

    Args:
        picture: As the source delivered it.
        box: The rectangle, in pixels of the picture after it is flipped.
        flip: The flip that will be applied to the returned picture.

    Raises:
        PayloadError: ``region_outside``, ``corrupt``.
    """
    try:
        check_region(box, picture.width, picture.height)
    except ParameterRefused as refused:  # since it was set, the source changed its size
        raise PayloadError("region_outside", refused.error) from None
    x, y, width, height = box
    x = picture.width - x - width if flip in ("horizontal", "both") else x
    y = picture.height - y - height if flip in ("vertical", "both") else y
    stored = None if picture.stored is None else picture.stored.cropped((x, y, width, height))
    pixels: Pixels | None = None
    if stored is None:
        part = decoded(picture, picture.encoding)[y : y + height, x : x + width]
        pixels = part.copy()  # so that the rest is not kept in memory
    truth = picture.truth
    if truth is not None:
        seen = (_cut_out(track, (x, y, width, height)) for track in truth)
        truth = tuple(track for track in seen if track is not None)
    return replace(
        picture, width=width, height=height, pixels=pixels, jpeg=None, stored=stored, truth=truth
    )


def _cut_out(track: Track, box: Box) -> Track | None:
    """Return the part of an object that is seen in a rectangle; None if no part of it is.

    If the edge cuts the object, its area is estimated by the share of its box that is inside.
    """
    left, top = max(0, track.box[0] - box[0]), max(0, track.box[1] - box[1])
    right = min(box[2], track.box[0] + track.box[2] - box[0])
    bottom = min(box[3], track.box[1] + track.box[3] - box[1])
    wide, high = right - left, bottom - top
    if wide <= 0 or high <= 0:
        return None
    return track.model_copy(
        update={
            "box": (left, top, wide, high),
            "x": float(left + int(wide / 2)),
            "y": float(top + int(high / 2)),
            "area": track.area * wide * high / (track.box[2] * track.box[3]),
        }
    )
