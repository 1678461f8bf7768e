"""The streams that are watched now: one subscription per key for any number of clients."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import zenoh

from zenoh_vision.errors import VisionError
from zenoh_vision.image.depth import RangeFinder
from zenoh_vision.image.frame import Frame
from zenoh_vision.stream.frame_intake import snapshot_of
from zenoh_vision.transport.subscriber import sample_of
from zv.viewer.streams.message_stream import MessageFeed, MessageStream
from zv.viewer.streams.picture_stream import PictureFeed, PictureStream
from zv.viewer.streams.rendering import EncodedPicture, RenderOptions, cost, original, render
from zv.viewer.streams.shared_stream import RENDER_THREADS, SharedStream, StreamContext
from zv.viewer.topics import kind_of

MAX_KEYS = 256
"""Limit of simultaneous subscriptions; beyond it, each client still has an equal share."""

QUERY_S = 1.0
SNAPSHOT_BYTES = 1 << 20
"""Limit of all replies but the first; small ones may come before the picture."""

MAX_QUERIES = 32
"""Limit of simultaneous queries for single pictures."""

S = TypeVar("S", bound=SharedStream[Any])


MAX_HELD_BYTES = 64 << 20
"""Limit of the pictures that are held at once to make or send snapshots. One alone may be larger.
"""


class TooManyBytes(VisionError):
    """More bytes of snapshots are requested than the viewer holds."""


class TooManyStreams(VisionError):
    """More streams are requested than the viewer subscribes to."""


class StreamRegistry:
    """Opens a stream for its first client and shares it with the others; used on the event loop."""

    def __init__(self, context: StreamContext) -> None:
        self.context = context
        self.clients = 1  # the number of clients, which share the limit of streams equally
        self._pictures: dict[str, PictureStream] = {}
        self._messages: dict[str, MessageStream] = {}
        self._queries = asyncio.Semaphore(MAX_QUERIES)
        self._rendering = asyncio.Semaphore(RENDER_THREADS)
        self._held = 0

    def pictures(
        self, key: str, options: RenderOptions, ready: asyncio.Event | None = None, has: int = 0
    ) -> PictureFeed:
        """Return a feed of the pictures of a key; it sets ``ready`` when one can be taken.

        Like ``messages``, it raises TooManyStreams if the limit of keys is reached and the client
        has its share; ``has`` is the number of its streams.
        """
        return self._stream(PictureStream, self._pictures, key, has).feed(options, ready)

    def messages(self, key: str, ready: asyncio.Event, has: int = 0) -> MessageFeed:
        """Return a feed of the messages of a key; it sets ``ready`` when one can be taken."""
        return MessageFeed(self._stream(MessageStream, self._messages, key, has), ready)

    async def snapshot(
        self, key: str, options: RenderOptions, charge: Callable[[int], None]
    ) -> EncodedPicture | None:
        """Return the newest picture of a key; None if none arrives in time.

        It is taken from an open stream, else from the publisher's reply to a query, else from a
        new subscription. ``charge`` is called with its pixels before it is rendered, and may raise
        an error instead.

        Raises:
            TooManyStreams: A subscription is needed, but the limit of keys is reached.
            TooManyBytes: As for ``hold``.
            PayloadError: The sample is not a picture, or cannot be decoded.
        """
        wait_s = self.context.settings().wait
        end_s = time.monotonic() + wait_s
        stream = self._pictures.get(key)
        if stream is not None and stream.newest is not None and stream.ended_ns is None:
            return await self._render(stream.newest_frame, options, charge, stream.finder)
        async with self._queries:
            time_s = min(QUERY_S, wait_s)
            ask = self.context.network.ask
            replies = await ask(key, timeout_s=time_s, most_bytes=SNAPSHOT_BYTES)
            sample = next((each.ok for each in replies if each.ok and each.key == key), None)
            if sample is not None:
                settings = self.context.settings()
                finder = RangeFinder((settings.depth_min, settings.depth_max))
                with self.hold(len(sample.payload)):
                    found = self._frame(key, sample)
                    return await self._render(lambda: found, options, charge, finder)
        feed = self.pictures(key, options)  # its publisher answers no queries
        try:
            if not await feed.stream.wait(max(0.05, end_s - time.monotonic())):
                return None
            charge(cost(feed.stream.newest_frame(), options))
            return await feed.next(max(0.05, end_s - time.monotonic()))
        finally:
            feed.close()

    @contextmanager
    def hold(self, size: int) -> Iterator[None]:
        """Count the bytes of a snapshot as held, or raise TooManyBytes."""
        if self._held and self._held + size > MAX_HELD_BYTES:
            raise TooManyBytes(
                f"snapshots of {self._held} bytes are being made or sent, {size} more are too "
                f"many; the maximum is {MAX_HELD_BYTES}"
            )
        self._held += size
        try:
            yield
        finally:
            self._held -= size

    def open(self) -> None:
        """Subscribe to all keys that are watched: there is a session now."""
        streams: list[SharedStream[Any]] = [*self._pictures.values(), *self._messages.values()]
        for stream in streams:
            stream.open()

    def _frame(self, key: str, sample: zenoh.Sample) -> Frame:
        return snapshot_of(sample_of(sample), kind_of(key).type, self.context.settings().max_pixels)

    async def _render(
        self,
        newest: Callable[[], Frame],
        options: RenderOptions,
        charge: Callable[[int], None],
        finder: RangeFinder,
    ) -> EncodedPicture:
        # Neither those that wait for a thread nor the traceback of a refusal hold a frame, whose
        # pixels may take 100 MB.
        charge(cost(newest(), options))
        async with self._rendering:
            frame = newest()
            found = original(frame, options)
            if found is None:
                quality = self.context.settings().quality
                found = await self.context.run(render, frame, options, quality, finder)
        return found

    def _stream(self, kind: type[S], streams: dict[str, S], key: str, has: int) -> S:
        """Return the open stream of a key, or open it."""
        stream = streams.get(key)
        if stream is None:
            share = max(1, MAX_KEYS // max(1, self.clients))
            if has >= share and len(self._pictures) + len(self._messages) >= MAX_KEYS:
                raise TooManyStreams(
                    f"{MAX_KEYS} streams are watched already, {has} of them by this client; the "
                    f"maximum is then {share}"
                )
            stream = streams[key] = kind(self.context, key, streams.pop)
            stream.open()
        return stream
