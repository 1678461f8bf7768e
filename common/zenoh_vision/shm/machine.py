"""Whether this process can use shared memory, and which other processes share that memory."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
from functools import cache
from pathlib import Path

MEMORY = Path("/dev/shm")  # noqa: S108 - where Linux has shared memory
FULL = f"{MEMORY} is full"
FUTEX_NUMBERS = {"x86_64": 202, "aarch64": 98}
"""Number of the system call ``futex`` by ``platform.machine()``."""


class SharedMemoryError(Exception):
    """Shared memory cannot be used; the text says why."""


def why_impossible() -> str:
    """Return why this process cannot use shared memory; empty if it can.

    iceoryx2 is looked for, not imported: that takes a third of a second.
    """
    if platform.system() != "Linux" or platform.machine() not in FUTEX_NUMBERS:
        return f"shared memory is not supported on {platform.system()} {platform.machine()}"
    if importlib.util.find_spec("iceoryx2") is None:
        return "iceoryx2 is not installed: pip install 'zenoh-vision[shm]'"
    if not os.access(MEMORY, os.W_OK):
        return f"{MEMORY} cannot be written to"
    try:
        machine_identity()
    except OSError as error:
        return f"this machine cannot be told from others: {error}"
    return ""


@cache
def machine_identity() -> str:
    """Return a name that only processes with the same memory have, in hexadecimal.

    Containers have a /dev/shm of their own, which is another device, unless they share it.
    """
    boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    parts = (boot, str(MEMORY.stat().st_dev), str(os.getuid()))
    return hashlib.sha256(" ".join(parts).encode()).hexdigest()[:16]


def channel_name(key: str) -> str:
    """Return the name in shared memory of the offer with this key, which is unique."""
    return hashlib.sha256(key.encode()).hexdigest()[:32]


def folder() -> Path:
    """Return the folder of this user's doorbells and of iceoryx2's files; make it if needed.

    Raises:
        SharedMemoryError: It cannot be made, or belongs to another user.
    """
    found = MEMORY / f"zenoh_vision_{os.getuid()}"
    try:
        found.mkdir(mode=0o700, exist_ok=True)
        owner = found.lstat()
    except OSError as error:
        raise SharedMemoryError(f"{found}: {error.strerror}") from None
    if owner.st_uid != os.getuid() or owner.st_mode & 0o170777 != 0o040700:
        raise SharedMemoryError(f"{found} belongs to someone else, or is open to others")
    return found


def free_bytes() -> int:
    """Return how many bytes of shared memory are free."""
    found = os.statvfs(MEMORY)
    return found.f_bavail * found.f_frsize
