"""Writes a file as a whole: it is complete, or as it was before."""

from __future__ import annotations

import os
import shutil
from contextlib import suppress
from pathlib import Path

from zenoh_vision.errors import SourceError


def write_file(path: str | Path, content: bytes) -> None:
    """Write a file: other programs see the old one or the new one, and a full disk leaves the old.

    A link stays a link. What is no file, such as ``/dev/stdout`` or a pipe, is written directly.

    Raises:
        SourceError: It cannot be written.
    """
    part = None
    try:
        target = Path(path).resolve()
        if target.exists() and not target.is_file():
            target.write_bytes(content)
            return
        part = target.with_name(f".{target.name}.{os.getpid()}")
        part.write_bytes(content)
        if target.exists():
            shutil.copymode(target, part)
        part.replace(target)
    except (OSError, ValueError) as error:
        if part is not None:
            with suppress(OSError):  # what failed first is the reason
                part.unlink(missing_ok=True)
        raise SourceError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
