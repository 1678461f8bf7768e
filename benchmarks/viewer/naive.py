"""A server like web_video_server, for comparison: decodes and encodes pictures for every client.

ENDPOINT PORT: serves ``/stream`` and, with it in an ``<img>``, ``/stream_viewer`` until SIGTERM. As
in web_video_server, each client gets the newest picture, encoded at quality 95, directly followed
by the boundary, and the header of the next part with the next picture. Unlike there, all clients
share the subscription, since 50 of them would wait for one another in Python.
"""

from __future__ import annotations

import asyncio
import sys
import threading
from contextlib import suppress

import cv2
import numpy as np
import zenoh
from aiohttp import web

from zenoh_vision.image import codecs
from zenoh_vision.stream.buffer import Buffer, latest
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.session import direct, open_session

KEY = "vision/front/image/compressed"
QUALITY = 95
BOUNDARY = b"boundarydonotcross"
POLL_S = 0.2


class Encoder:
    """The pictures of one client, on a thread of its own: decoded, resized, encoded.

    Args:
        size: Width and height of the client's pictures, pixels; None for the camera's.
    """

    def __init__(self, size: tuple[int, int] | None) -> None:
        self.newest = Buffer[bytes](latest, lambda _: None)
        self.ready: asyncio.Queue[bytes] = asyncio.Queue(1)
        self._loop = asyncio.get_running_loop()
        self._size = size
        self._ended = threading.Event()
        threading.Thread(target=self._work, daemon=True).start()

    def close(self) -> None:
        """End the thread."""
        self._ended.set()

    def _work(self) -> None:
        while not self._ended.is_set():
            payload = self.newest.take(POLL_S)
            if payload is None:
                continue
            pixels = codecs.decode_jpeg(payload, "bgr8")
            if self._size is not None:
                pixels = np.asarray(cv2.resize(pixels, self._size), np.uint8)
            jpeg = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._offer, jpeg)

    def _offer(self, jpeg: bytes) -> None:
        if self.ready.full():
            self.ready.get_nowait()
        self.ready.put_nowait(jpeg)


def application(encoders: set[Encoder]) -> web.Application:
    """Return the server; ``encoders`` has one entry for each client."""

    async def stream(request: web.Request) -> web.StreamResponse:
        query = request.query
        size = (int(query["width"]), int(query["height"])) if "width" in query else None
        answer = web.StreamResponse()
        answer.headers["Content-Type"] = f"multipart/x-mixed-replace;boundary={BOUNDARY.decode()}"
        encoder = Encoder(size)
        encoders.add(encoder)
        try:
            await answer.prepare(request)
            await answer.write(b"--%s\r\n" % BOUNDARY)
            while True:
                jpeg = await encoder.ready.get()
                head = b"Content-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(jpeg)
                await answer.write(b"%s%s\r\n--%s\r\n" % (head, jpeg, BOUNDARY))
        finally:
            encoders.remove(encoder)
            encoder.close()

    async def stream_viewer(request: web.Request) -> web.Response:
        source = f"/stream?{request.query_string}"
        return web.Response(text=f'<img src="{source}">', content_type="text/html")

    served = web.Application()
    served.router.add_get("/stream", stream)
    served.router.add_get("/stream_viewer", stream_viewer)
    return served


def main() -> None:
    """Serve."""
    cv2.setNumThreads(1)
    encoders: set[Encoder] = set()

    def on_sample(sample: zenoh.Sample) -> None:
        payload = sample.payload.to_bytes() if encoders else b""
        for encoder in encoders.copy():
            encoder.newest.put(payload)

    session = open_session(Connection(connect=sys.argv[1], timeout_s=20))
    session.declare_subscriber(KEY, direct(on_sample))
    web.run_app(application(encoders), host="127.0.0.1", port=int(sys.argv[2]), print=None)


if __name__ == "__main__":
    main()
