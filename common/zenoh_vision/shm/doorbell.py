"""A number in shared memory that receivers wait for: a futex, which wakes any number of them.

A thread that waits for it blocks no other, unlike one that waits for an event of iceoryx2. The
owner of a doorbell locks its file, so an unlocked file was left by a killed process.
"""

from __future__ import annotations

import ctypes
import fcntl
import mmap
import os
import platform
from contextlib import suppress
from pathlib import Path
from typing import Self

from zenoh_vision.shm.machine import FULL, FUTEX_NUMBERS, SharedMemoryError, folder, free_bytes

SUFFIX = ".bell"
SIZE = mmap.PAGESIZE
FUTEX_WAIT, FUTEX_WAKE = 0, 1
ALL = 0x7FFFFFFF


class _TimeSpec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class Doorbell:
    """A number that one process increments and others wait for.

    Args:
        file: Descriptor of the file, which this closes.
        path: Of the file; removed on closing if this process is the owner.
        owned: Whether this process made it.
    """

    def __init__(self, file: int, path: Path, *, owned: bool) -> None:
        self._file = file
        self._path = path
        self._owned = owned
        self._memory = mmap.mmap(file, SIZE)
        self._number = ctypes.c_uint32.from_buffer(self._memory)
        self._futex = ctypes.CDLL(None).syscall  # releases the interpreter's lock while it waits
        self._call = FUTEX_NUMBERS[platform.machine()]

    @classmethod
    def create(cls, name: str) -> Self:
        """Make a doorbell, and remove those of dead processes.

        Raises:
            SharedMemoryError: There is no room, or it exists.
        """
        remove_dead()
        path = _path_of(name)
        if free_bytes() < 2 * SIZE:
            raise SharedMemoryError(FULL)
        try:
            file = os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise SharedMemoryError(f"{path}: {error.strerror}") from None
        try:
            fcntl.flock(file, fcntl.LOCK_EX)
            if not os.fstat(file).st_nlink:  # another process removed it as a dead one's
                os.close(file)
                return cls.create(name)
            os.posix_fallocate(file, 0, SIZE)
        except OSError as error:
            path.unlink(missing_ok=True)
            os.close(file)
            raise SharedMemoryError(f"{path}: {error.strerror}") from None
        return cls(file, path, owned=True)

    @classmethod
    def open(cls, name: str) -> Self:
        """Open the doorbell of another process.

        Raises:
            SharedMemoryError: There is none of this name in this machine's memory.
        """
        path = _path_of(name)
        try:
            file = os.open(path, os.O_RDWR | os.O_CLOEXEC)
            if os.fstat(file).st_size < SIZE:
                os.close(file)
                raise SharedMemoryError(f"{path} is not complete")
        except OSError as error:
            raise SharedMemoryError(f"{path}: {error.strerror}") from None
        return cls(file, path, owned=False)

    @classmethod
    def exists(cls, name: str) -> bool:
        """Tell whether a process of this user has made a doorbell of this name."""
        try:
            return _path_of(name).exists()
        except SharedMemoryError:
            return False

    @property
    def number(self) -> int:
        """How often it was rung; starts again at 0 after 2^32."""
        return self._number.value

    def ring(self) -> None:
        """Increment the number and wake all who wait."""
        self._number.value += 1
        self.wake()

    def wake(self) -> None:
        """End all waits for it, although the number is the same."""
        self._futex(self._call, ctypes.byref(self._number), FUTEX_WAKE, ALL, None, None, 0)

    def wait(self, seen: int, timeout_s: float) -> int:
        """Wait until the number is another one than was seen, or for the time-out; return it.

        It may end sooner, by ``wake``.
        """
        seconds = int(timeout_s)
        limit = _TimeSpec(seconds, int((timeout_s - seconds) * 1e9))
        number, value = ctypes.byref(self._number), ctypes.c_uint32(seen)
        self._futex(self._call, number, FUTEX_WAIT, value, ctypes.byref(limit), None, 0)
        return self._number.value

    def close(self) -> None:
        """Release the memory; the owner removes the file. Nobody may wait for it any more."""
        if self._owned:
            self._path.unlink(missing_ok=True)
        del self._number
        self._memory.close()
        os.close(self._file)


def _path_of(name: str) -> Path:
    return folder() / f"{name}{SUFFIX}"


def remove_dead() -> None:
    """Remove the doorbells of processes that have ended without closing them."""
    for path in folder().glob(f"*{SUFFIX}"):
        with suppress(OSError):
            file = os.open(path, os.O_RDWR | os.O_CLOEXEC)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                path.unlink()
            finally:
                os.close(file)
