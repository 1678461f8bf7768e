"""Checks options of libav by its own tables, and finds hardware that decodes."""

from __future__ import annotations

import ctypes
import logging
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

import av
from av.codec.hwaccel import HWAccel, hwdevices_available
from av.error import FFmpegError

from zenoh_vision.error_text import shortened
from zenoh_vision.errors import SourceError

log = logging.getLogger(__name__)

SEARCH_CHILDREN_OF_CLASS: Final = 3  # AV_OPT_SEARCH_CHILDREN | AV_OPT_SEARCH_FAKE_OBJ

DEVICE_FILES: Final = {
    "cuda": ("/dev/nvidia0", "/dev/nvhost-gpu"),
    "vaapi": ("/dev/dri/renderD128", "/dev/dri/renderD129"),
    "qsv": ("/dev/dri/renderD128", "/dev/dri/renderD129"),
    "vdpau": ("/dev/nvidia0",),
    "drm": ("/dev/dri/renderD128", "/dev/video10"),
    "vulkan": ("/dev/dri/renderD128", "/dev/dri/renderD129"),
}
"""What exists where a kind of decoder may work; other kinds are tried anyway."""


@dataclass(frozen=True, slots=True)
class Hardware:
    """A hardware decoder that works here, and its kind."""

    kind: str
    accelerator: HWAccel


def options_of(text: str) -> dict[str, str]:
    """Return the options in ``NAME=VALUE,NAME=VALUE``.

    Raises:
        ValueError: It has another form, or libav has no such option.
    """
    found: dict[str, str] = {}
    for part in filter(None, text.split(",")):
        name, separator, value = part.partition("=")
        if not separator:
            raise ValueError(f"{shortened(part)} is not NAME=VALUE")
        if not _exists(name.strip()):
            raise ValueError(
                f"libav has no option {shortened(name.strip())}; allowed: those of its formats and "
                "protocols, see ffmpeg -h full"
            )
        found[name.strip()] = value
    return found


@cache
def _exists(name: str) -> bool:
    libav = ctypes.CDLL(av._core.__file__)
    if not (hasattr(libav, "avformat_get_class") and hasattr(libav, "av_opt_find")):
        return True  # on Windows: libav ignores what it does not know
    libav.avformat_get_class.restype = libav.av_opt_find.restype = ctypes.c_void_p
    table = ctypes.c_void_p(libav.avformat_get_class())
    option = libav.av_opt_find(
        ctypes.byref(table), name.encode(), None, 0, SEARCH_CHILDREN_OF_CLASS
    )
    return bool(option)


def hardware(wanted: str) -> Hardware | None:
    """Return the hardware decoder to use; None for the CPU.

    What worked once may be gone, or in use up to its limit, when a source is opened again.

    Args:
        wanted: ``auto``, ``none``, or a kind that libav knows: ``cuda``, ``vaapi``, ...

    Raises:
        SourceError: A kind was asked for, and does not work here.
    """
    if wanted == "none":
        return None
    built_in = hwdevices_available()
    if wanted != "auto" and wanted not in built_in:
        allowed = ", ".join(("auto", "none", *built_in))
        raise SourceError(f"hwaccel = {wanted}: libav is built without it; allowed: {allowed}")
    reasons = []
    for kind in built_in if wanted == "auto" else [wanted]:
        files = DEVICE_FILES.get(kind, ())
        if files and not any(Path(file).exists() for file in files):
            reasons.append(f"{kind}: there is no {files[0]}")
            continue
        accelerator = HWAccel(kind, allow_software_fallback=True)
        try:
            accelerator.create(av.Codec("h264", "r"))
        except (FFmpegError, NotImplementedError, RuntimeError) as error:
            reasons.append(f"{kind}: {getattr(error, 'strerror', None) or error}")
            continue
        return Hardware(kind, accelerator)
    if wanted != "auto":
        raise SourceError(f"hwaccel = {wanted} does not work here: {'; '.join(reasons)}")
    log.debug("no hardware decoder works here: %s", "; ".join(reasons))
    return None
