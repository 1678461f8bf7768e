"""Writes the frames of one camera to shared memory."""

from __future__ import annotations

import ctypes
import errno
import mmap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from zenoh_vision.image.forms import FORMS, RAW_FORM
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.pixel_formats import raw_size
from zenoh_vision.shm.channel import LEAST_FREE, MAX_ENCODING, Layout, iceoryx_errors, open_channel
from zenoh_vision.shm.doorbell import Doorbell
from zenoh_vision.shm.machine import FULL, SharedMemoryError, free_bytes

MADV_POPULATE_WRITE = 23
HEADER_ROOM = 1024
"""Bytes after the pixels for the header; ample, so that a longer header needs no new memory."""


class FrameWriter:
    """Sends frames to the readers of one offer; used by one thread.

    Args:
        offer: Its name. Only its doorbell is made before the first frame.

    Raises:
        SharedMemoryError: The doorbell cannot be made.
    """

    def __init__(self, offer: str) -> None:
        self._offer = offer
        self._bell = Doorbell.create(offer)
        self._node: Any = None
        self._service: Any = None
        self._publisher: Any = None
        self._room = 0
        self._readers = 0  # that got the last frame
        self._pieces: dict[int, NDArray[np.uint8]] = {}  # ten or so, used in turn, by address
        self._madvise = ctypes.CDLL(None, use_errno=True).madvise

    def write(self, frame: Frame) -> bool:
        """Send a frame, if there is a reader; never waits.

        Returns:
            Whether a reader gets it.

        Raises:
            SharedMemoryError: There is no memory for it.
            PayloadError: The picture cannot be decoded.
        """
        # A JPEG or PNG goes as it is: it is smaller, and its receiver may need only a part of it.
        file = None if frame.picture.form is None else frame.compressed
        form = RAW_FORM if file is None else FORMS[frame.picture.mime]
        header = frame.header
        attachment = form.header(header).to_bytes()
        size = raw_size(header.encoding, header.width, header.height) if file is None else len(file)
        whole = size + len(attachment)
        if len(form.encoding) > MAX_ENCODING:
            raise SharedMemoryError(f"a Zenoh encoding of over {MAX_ENCODING} characters")
        with iceoryx_errors():
            if self._publisher is None or whole > self._room:
                self._make_room(whole if file is None else 2 * whole)
            # Asked only if the last frame had no reader, since it takes as long as the sending.
            if not self._readers and not self._service.dynamic_config.number_of_subscribers:
                return False
            loan = self._publisher.loan_slice_uninit(whole)
            try:
                address = loan.payload_ptr
                if (memory := self._pieces.get(address)) is None:
                    memory = self._pieces[address] = self._piece_at(address)
                if file is None:
                    frame.write(memory[:size])
                else:
                    memory[:size] = np.frombuffer(file, np.uint8)
                memory[size:whole] = np.frombuffer(attachment, np.uint8)
                layout = Layout.from_address(loan.user_header_ptr)
                layout.payload, layout.attachment = size, len(attachment)
                layout.encoding = form.encoding.encode("ascii")
            except BaseException:
                del loan  # the only one there may be: it would last as long as the exception
                raise
            self._readers = int(loan.assume_init().send())
        self._bell.ring()
        return self._readers > 0

    def close(self) -> None:
        """Release the memory; readers that hold views keep theirs."""
        self._pieces.clear()
        self._publisher = self._service = self._node = None
        self._bell.close()

    def _make_room(self, size: int) -> None:
        """Have memory for pieces of a size."""
        if free_bytes() < size + LEAST_FREE:
            raise SharedMemoryError(FULL)
        if self._service is None:
            self._node, self._service = open_channel(self._offer)
        self._pieces.clear()
        self._publisher = None  # there may be only one at a time
        self._room = size + HEADER_ROOM
        builder = self._service.publisher_builder().initial_max_slice_len(self._room)
        self._publisher = builder.max_loaned_samples(1).create()

    def _piece_at(self, address: int) -> NDArray[np.uint8]:
        """Reserve the piece of memory at an address, so that it can be written to; return it."""
        start = address - address % mmap.PAGESIZE
        length = ctypes.c_size_t(address + self._room - start)
        if self._madvise(ctypes.c_void_p(start), length, MADV_POPULATE_WRITE):
            old_kernel = ctypes.get_errno() == errno.EINVAL  # before Linux 5.14
            if not old_kernel or free_bytes() < self._room + LEAST_FREE:
                raise SharedMemoryError(FULL)
        # iceoryx2 writes the head of the next piece when that is loaned, before it is reserved.
        after = ctypes.c_void_p(start + length.value + -length.value % mmap.PAGESIZE)
        failed = self._madvise(after, ctypes.c_size_t(mmap.PAGESIZE), MADV_POPULATE_WRITE)
        if failed and ctypes.get_errno() not in (errno.EINVAL, errno.ENOMEM):  # the last piece
            raise SharedMemoryError(FULL)
        return np.ctypeslib.as_array((ctypes.c_uint8 * self._room).from_address(address))
