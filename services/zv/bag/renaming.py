"""Gives a file another name, which no file may have, so that the name outlasts a power cut."""

from __future__ import annotations

import ctypes
import errno
import os
from pathlib import Path
from typing import Final

from zv.bag.record import RecordingError

RENAME_NOREPLACE: Final = 1
AT_FDCWD: Final = -100
UNSUPPORTED: Final = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)
"""What a file system says that cannot rename so."""


def rename_new(source: Path, target: Path) -> None:
    """Give a file another name, which no file may have; at each moment it has one of the two.

    Raises:
        RecordingError: There is such a file.
        OSError: It cannot be renamed.
    """
    try:
        exclusively_renamed(source, target)
    except FileExistsError:
        raise RecordingError(f"{target} exists already; the recording stays {source}") from None
    sync_folder(target.parent)


def exclusively_renamed(source: Path, target: Path) -> None:
    """Rename a file in one step, which fails if there is a file of that name.

    A link that is made and one that is removed would be two steps, of which a power cut may keep
    only the second.

    Raises:
        FileExistsError: There is such a file.
        OSError: It cannot be renamed.
    """
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is not None:
        names = os.fsencode(source), AT_FDCWD, os.fsencode(target)
        if rename(AT_FDCWD, *names, RENAME_NOREPLACE) == 0:
            return
        error = ctypes.get_errno()
        if error not in UNSUPPORTED:
            raise OSError(error, os.strerror(error), str(source), None, str(target))
    if target.exists():
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target))
    source.rename(target)


def sync_folder(path: Path) -> None:
    """Wait until the names in a folder are on the disk.

    Raises:
        OSError: The disk failed.
    """
    folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
