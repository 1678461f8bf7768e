"""A doorbell that cannot be made leaves nothing behind."""

from __future__ import annotations

import errno
import os
from uuid import uuid4

import pytest

from zenoh_vision.shm.doorbell import Doorbell
from zenoh_vision.shm.machine import SharedMemoryError


def test_a_doorbell_for_which_there_is_no_room_leaves_neither_file_nor_descriptor(
    monkeypatch: pytest.MonkeyPatch,
):
    name, files = f"zv_test_{uuid4().hex}", []

    def full(file: int, offset: int, length: int) -> None:
        files.append((file, offset, length))
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "posix_fallocate", full)
        with pytest.raises(SharedMemoryError, match="No space left on device"):
            Doorbell.create(name)
    [(file, _, _)] = files
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(file)
    Doorbell.create(name).close()  # a file that was left would be in its way
