"""The service of iceoryx2 that carries the frames of one offer, the same for both of its sides."""

from __future__ import annotations

import ctypes
import os
import threading
from contextlib import suppress
from typing import Any

from zenoh_vision.shm.machine import FULL, MEMORY, SharedMemoryError, folder, free_bytes

CONSUMERS = 16
"""Most consumers of one camera through shared memory; the others take JPEG."""

VIEWS = 4
"""Most samples that a consumer holds: in work, waiting, arriving, and one that it keeps."""

PREFIX = "zenoh_vision_"
MAX_ENCODING = 63
LEAST_FREE = 1 << 20
"""Less is not enough for iceoryx2's own files, of some kilobytes each."""


class Layout(ctypes.Structure):
    """The header of a sample of iceoryx2: how its bytes are divided, and the payload's encoding."""

    _fields_ = (
        ("payload", ctypes.c_uint64),
        ("attachment", ctypes.c_uint64),
        ("encoding", ctypes.c_char * (MAX_ENCODING + 1)),
    )


def open_channel(offer: str) -> tuple[Any, Any]:
    """Return a node of iceoryx2 and the service of an offer, which either side may open first.

    Opening one removes what dead processes left.

    Raises:
        SharedMemoryError: It cannot be opened.
    """
    try:
        import iceoryx2  # takes a third of a second, and only some processes need it
    except Exception as error:  # of another version, or for another C library
        raise SharedMemoryError(f"iceoryx2 cannot be imported: {error}") from None
    prefix = secret_prefix()
    if free_bytes() < LEAST_FREE:
        raise SharedMemoryError(FULL)
    iceoryx2.set_log_level(iceoryx2.LogLevel.Fatal)
    config = iceoryx2.config.default()
    config.global_cfg.root_path = iceoryx2.Path.new(f"{folder()}/")
    config.global_cfg.prefix = iceoryx2.FileName.new(prefix)
    with iceoryx_errors():
        node = (
            iceoryx2.NodeBuilder.new()
            .config(config)
            .signal_handling_mode(iceoryx2.SignalHandlingMode.Disabled)
            .create(iceoryx2.ServiceType.Ipc)
        )
        for shared in MEMORY.glob(f"{prefix}*.global_mgmt"):
            shared.chmod(0o600)  # iceoryx2 lets every user write to it
        service = (
            node.service_builder(iceoryx2.ServiceName.new(f"zenoh-vision/2/{offer}"))
            .publish_subscribe(iceoryx2.Slice[ctypes.c_uint8])
            .user_header(Layout)
            .enable_safe_overflow(True)
            .subscriber_max_buffer_size(1)
            .subscriber_max_borrowed_samples(VIEWS)
            .history_size(0)
            .max_publishers(1)
            .max_subscribers(CONSUMERS)
            .max_nodes(CONSUMERS + 2)
            .open_or_create()
        )
    return node, service


def secret_prefix() -> str:
    """Return the prefix of the names of iceoryx2's files, which no other user can predict."""
    path = folder() / "prefix"
    if not path.exists():
        mine = folder() / f"prefix.{os.getpid()}.{threading.get_ident()}"
        mine.write_text(f"{PREFIX}{os.urandom(8).hex()}_")
        with suppress(FileExistsError):
            os.link(mine, path)
        mine.unlink()
    return path.read_text()


class iceoryx_errors:  # noqa: N801 - used like a function
    """Turns what iceoryx2 raises into a ``SharedMemoryError``."""

    def __enter__(self) -> None:
        """Begin."""

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        """Raise the error of iceoryx2 as one of ours."""
        if isinstance(error, Exception) and type(error).__module__.startswith("iceoryx2"):
            raise SharedMemoryError(f"iceoryx2: {type(error).__name__} {error}") from error
