"""Converts planes to BGR in memory of any owner, with the libswscale that PyAV brings along.

PyAV itself converts only into new memory, from which the pixels would have to be copied to shared
memory; that takes nearly as long as the conversion.
"""

from __future__ import annotations

import ctypes
import threading
import weakref
from collections.abc import Sequence
from typing import Final

import numpy as np
from av.video import reformatter
from av.video.plane import VideoPlane
from numpy.typing import NDArray

from zenoh_vision.errors import PayloadError

BILINEAR: Final = 2
"""What PyAV chooses; libswscale's other ways of converting differ from it in some pixels."""
BT_601: Final = 5
UNCHANGED: Final = (0, 1 << 16, 1 << 16)
"""Brightness, contrast and saturation."""
BLOCK: Final = 16
"""Pixels that libswscale converts at once. It writes whole blocks only, some of them beyond the
row, so rows of other widths would need padding behind them."""
FUNCTIONS: Final = (
    *("sws_getContext", "sws_freeContext", "sws_getCoefficients", "sws_setColorspaceDetails"),
    *("sws_scale", "av_get_pix_fmt"),
)

_Pointers = ctypes.c_void_p * 4
_Strides = ctypes.c_int * 4


def _libraries() -> ctypes.CDLL | None:
    """Return the functions of libswscale and libavutil; None where they cannot be found."""
    try:
        found = ctypes.CDLL(reformatter.__file__)  # finds the functions of its dependencies too
    except OSError:  # it is no file, as in a program packed into one
        return None
    if not all(hasattr(found, name) for name in FUNCTIONS):  # on Windows
        return None
    found.sws_getContext.restype = found.sws_getCoefficients.restype = ctypes.c_void_p
    return found


_LIBRARIES: Final = _libraries()


class BgrWriter:
    """Converts the pictures of one stream; safe between threads."""

    def __init__(self) -> None:
        self._kind: tuple[int, int, bool] | None = None
        self._context = ctypes.c_void_p()
        self._lock = threading.Lock()

    def write(
        self, planes: Sequence[VideoPlane], *, full_range: bool, target: NDArray[np.uint8]
    ) -> bool:
        """Write the pixels of planes to memory; they are the same as PyAV's.

        Args:
            planes: Luma, blue and red chroma of a frame in 4:2:0 of BT.601, both sides even.
            full_range: Whether black is 0 and white 255.
            target: (height, width, 3), without gaps.

        Returns:
            False if that is not possible on this machine, or for this width.

        Raises:
            ValueError: The memory does not fit.
            PayloadError: ``corrupt``.
        """
        libraries, width, height = _LIBRARIES, planes[0].width, planes[0].height
        if libraries is None or width % BLOCK:
            return False
        if target.shape != (height, width, 3) or target.dtype != np.uint8:
            raise ValueError(f"{target.shape} {target.dtype} is no memory for {width}x{height} BGR")
        if not (target.flags.c_contiguous and target.flags.writeable):
            raise ValueError("the memory has gaps, or cannot be written to")
        with self._lock:
            if self._kind != (width, height, full_range):
                self._open(libraries, width, height, full_range)
            rows = libraries.sws_scale(
                self._context,
                _Pointers(*(plane.buffer_ptr for plane in planes)),
                _Strides(*(plane.line_size for plane in planes)),
                0,
                height,
                _Pointers(target.ctypes.data),
                _Strides(target.strides[0]),
            )
        if rows != height:
            raise PayloadError("corrupt", f"{rows} of {height} rows could be converted")
        return True

    def _open(self, libraries: ctypes.CDLL, width: int, height: int, full_range: bool) -> None:
        stored, made = map(libraries.av_get_pix_fmt, (b"yuv420p", b"bgr24"))
        sides = (width, height, stored, width, height, made)
        address = libraries.sws_getContext(*sides, BILINEAR, None, None, None)
        if not address:
            raise MemoryError("libswscale has no memory")
        self._context = ctypes.c_void_p(address)
        end = weakref.finalize(self._context, libraries.sws_freeContext, ctypes.c_void_p(address))
        end.atexit = False  # another thread may still use it
        colours = ctypes.c_void_p(libraries.sws_getCoefficients(BT_601))
        ranges = (colours, int(full_range), colours, 1)
        libraries.sws_setColorspaceDetails(self._context, *ranges, *UNCHANGED)
        self._kind = width, height, full_range
