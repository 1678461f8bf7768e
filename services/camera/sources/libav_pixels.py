"""From a decoded frame of libav to pixels in one of our encodings."""

from __future__ import annotations

import numpy as np
from av.video.format import VideoFormat
from av.video.frame import VideoFrame
from av.video.reformatter import VideoReformatter

from services.camera.sources.base import Pixels


def pixels_of(frame: VideoFrame, reformatter: VideoReformatter) -> tuple[Pixels, str]:
    """Return the pixels of a decoded frame, upright, and their encoding.

    Grey stays grey, with its depth; alpha is kept; everything else is BGR by the stream's own
    colour space and range, to the pixel as OpenCV converts streams that do not tag theirs.

    Args:
        frame: As the decoder gave it.
        reformatter: Kept from frame to frame.

    Returns:
        (height, width) uint8 or uint16, or (height, width, 3 or 4) uint8, and one of
        ``mono8 mono16 bgr8 bgra8``. Grey of 9 to 15 bits is scaled up to 16.
    """
    name, encoding = _target(frame.format)
    converted = reformatter.reformat(
        frame, format=name, src_color_range=frame.color_range, threads=1
    )
    pixels = converted.to_ndarray()
    if frame.rotation % 90 == 0 and frame.rotation % 360:
        pixels = np.rot90(pixels, frame.rotation // 90)
    if converted is frame or not pixels.flags.c_contiguous:
        pixels = pixels.copy()  # the decoder may still need its own
    return pixels, encoding  # type: ignore[return-value]  # 8 or 16 bits, by the formats asked for


def _target(source: VideoFormat) -> tuple[str, str]:
    components = source.components
    if any(component.is_alpha for component in components):
        return "bgra", "bgra8"
    if source.has_palette or source.is_rgb or len(components) != 1:
        return "bgr24", "bgr8"
    return ("gray16le", "mono16") if components[0].bits > 8 else ("gray", "mono8")
