"""The newest picture of a stream: the one that is here, else asked for, else waited for."""

from __future__ import annotations

import asyncio
import time

import zenoh

from common import images
from common.admission import Admission
from common.errors import PayloadError
from common.frame import Frame
from common.receiving import MAX_ATTACHMENT_BYTES
from services.viewer.hub import Hub
from services.viewer.rendering import Form, render
from services.viewer.topics import camera_of, kind_of
from services.viewer.wire import Picture

ASK_S = 1.0
MAX_ASKED = 32
"""Questions at once."""


class Latest:
    """Finds single pictures.

    Args:
        hub: The streams that are watched.
    """

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._free = asyncio.Semaphore(MAX_ASKED)

    async def picture(self, key: str, form: Form) -> Picture | None:
        """Return the newest picture of a key; None if none comes in time.

        Raises:
            TooMany: Too many streams are watched to wait for this one.
            PayloadError: What came is no picture, or cannot be decoded.
        """
        end_s = time.monotonic() + self._hub.options().wait
        stream = self._hub.newest(key)
        if stream is not None and stream.newest is not None and not stream.silent_s:
            arrival, frame = stream.newest
            return await self._render(key, frame, form, arrival.raw)
        async with self._free:
            timeout_s = min(ASK_S, self._hub.options().wait)
            for reply in await self._hub.network.ask(key, timeout_s=timeout_s):
                if reply.ok is not None and str(reply.ok.key_expr) == key:
                    frame = frame_of(key, reply.ok)
                    return await self._render(key, frame, form, kind_of(key).raw)
        feed = self._hub.watch(key, form)  # a publisher that keeps nothing for who asks
        try:
            return await feed.next(max(0.05, end_s - time.monotonic()))
        finally:
            feed.close()

    async def _render(self, key: str, frame: Frame, form: Form, raw: bool) -> Picture:
        header = frame.header
        if not raw and form.leaves(frame.mime, header.width, header.height):
            found = frame.compressed, frame.mime, header.width, header.height
        else:
            quality = self._hub.options().quality
            found = await self._hub.loop.run_in_executor(
                self._hub.pool, render, frame, form, quality
            )
        payload, mime, width, height = found
        return Picture(key, header, payload, mime, width, height, number=0, missed=0)


def frame_of(key: str, sample: zenoh.Sample) -> Frame:
    """Return the frame in an answer.

    Raises:
        PayloadError: It is none.
    """
    if len(sample.payload) > images.MAX_PIXELS * 4:
        raise PayloadError("too_large", f"{len(sample.payload)} bytes")
    attachment = sample.attachment
    if attachment is not None and len(attachment) > MAX_ATTACHMENT_BYTES:
        raise PayloadError("bad_header", f"an attachment of {len(attachment)} bytes")
    payload = sample.payload.to_bytes()
    raw = kind_of(key).raw
    header = Admission(camera_of(key)).identify(
        None if attachment is None else attachment.to_bytes(),
        None if raw else images.picture_size(payload),
        time.time_ns(),
        time.monotonic(),
    )
    if raw:
        pixels = images.from_raw(payload, header.encoding or "", header.width, header.height)
        return Frame(header, pixels=pixels)
    return Frame(header, compressed=payload)
