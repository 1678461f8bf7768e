"""A real MJPEG camera over HTTP, on a free port of the loopback interface, with bad manners.

Its paths are its manners: ``/sized``, ``/stall`` and so on, see the methods ``stream_...``
and ``answer_...``. Picture i is plain grey of level ``level(i)``.
"""

from __future__ import annotations

import base64
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, ClassVar, Self

import cv2
import numpy as np

WIDTH, HEIGHT = 64, 48
USER, PASSWORD = "viewer", "s3cr3t-word"
PICTURES_BEFORE_TROUBLE = 5


def level(index: int) -> int:
    """Return the grey level of a picture."""
    return 10 + index % 20 * 10


def picture(index: int) -> bytes:
    """Return a picture as a JPEG."""
    pixels = np.full((HEIGHT, WIDTH, 3), level(index), np.uint8)
    return cv2.imencode(".jpg", pixels)[1].tobytes()


def without_huffman_tables(jpeg: bytes) -> bytes:
    """Return a JPEG as cameras send it that leave the standard tables out."""
    kept, offset = jpeg[:2], 2
    while jpeg[offset + 1] != 0xDA:
        end = offset + 2 + int.from_bytes(jpeg[offset + 2 : offset + 4], "big")
        if jpeg[offset + 1] != 0xC4:
            kept += jpeg[offset:end]
        offset = end
    return kept + jpeg[offset:]


class HttpCamera:
    """The camera; a context manager.

    Attributes:
        rate_hz: How fast it sends.
        recording: What ``/recording`` is: the bytes of a video file.
    """

    def __init__(self, rate_hz: float = 50.0) -> None:
        self.rate_hz = rate_hz
        self.recording = b""
        self.stopped = threading.Event()
        handler = type("Handler", (_Handler,), {"camera": self})
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.stopped.set()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def url(self, path: str, credentials: str = "") -> str:
        """Return the URL of one of its manners."""
        return f"http://{credentials}127.0.0.1:{self._server.server_port}{path}"


class _Handler(BaseHTTPRequestHandler):
    camera: ClassVar[HttpCamera]

    def do_GET(self) -> None:
        name = self.path.partition("?")[0].strip("/")
        answer = getattr(self, f"answer_{name}", None)
        stream = getattr(self, f"stream_{name}", None)
        try:
            if answer is not None:
                answer()
            elif stream is not None:
                self._send(stream())
            else:
                self.send_error(404)
        except OSError:
            pass  # the client has gone

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        """Keep quiet."""

    def _send(self, chunks: Iterator[bytes], kind: str = "boundary=frame") -> None:
        self.send_response(200)
        self.send_header("Content-Type", f"multipart/x-mixed-replace; {kind}")
        self.end_headers()
        for chunk in chunks:
            self.wfile.write(chunk)
            if self.camera.stopped.wait(1.0 / self.camera.rate_hz):
                return

    def _pictures(
        self,
        count: int | None = None,
        make: Callable[[int], bytes] = picture,
        length: Callable[[bytes], int | None] = len,
        boundary: str = "frame",
    ) -> Iterator[bytes]:
        index = 0
        while count is None or index < count:
            jpeg = make(index)
            size = length(jpeg)
            sized = "" if size is None else f"Content-Length: {size}\r\n"
            head = f"--{boundary}\r\nContent-Type: image/jpeg\r\n{sized}\r\n"
            yield head.encode() + jpeg + b"\r\n"
            index += 1

    def stream_sized(self) -> Iterator[bytes]:
        return self._pictures()

    def stream_unsized(self) -> Iterator[bytes]:
        return self._pictures(length=lambda _: None)

    def stream_tables_missing(self) -> Iterator[bytes]:
        return self._pictures(make=lambda index: without_huffman_tables(picture(index)))

    def stream_padded(self) -> Iterator[bytes]:
        return self._pictures(make=lambda index: picture(index) + bytes(64))

    def stream_repeating(self) -> Iterator[bytes]:
        return self._pictures(make=lambda _: picture(0))

    def stream_hanging_up(self) -> Iterator[bytes]:
        return self._pictures(PICTURES_BEFORE_TROUBLE)

    def stream_cut(self) -> Iterator[bytes]:
        yield from self._pictures(PICTURES_BEFORE_TROUBLE)
        yield next(self._pictures())[:-200]

    def stream_stalling(self) -> Iterator[bytes]:
        yield from self._pictures(PICTURES_BEFORE_TROUBLE)
        self.camera.stopped.wait()

    def stream_dripping(self) -> Iterator[bytes]:
        yield from self._pictures(PICTURES_BEFORE_TROUBLE)
        yield from (bytes([byte]) for byte in next(self._pictures()) * 10)

    def stream_endless(self) -> Iterator[bytes]:
        """Send a picture that has no end, as fast as it goes."""
        yield from self._pictures(PICTURES_BEFORE_TROUBLE, length=lambda _: None)
        yield next(self._pictures(length=lambda _: None))[:-20]
        while not self.camera.stopped.is_set():
            self.wfile.write(bytes(1 << 20))

    def answer_endless_jpeg(self) -> None:
        """Send a bare JPEG that has no end."""
        self.send_response(200)
        self.send_header("Content-Type", "image/jpeg")
        self.end_headers()
        self.wfile.write(picture(0)[:-20])
        while not self.camera.stopped.is_set():
            self.wfile.write(bytes(1 << 20))

    def stream_hiccuping(self) -> Iterator[bytes]:
        """Send every third picture cut short."""
        return self._pictures(make=lambda index: picture(index)[: -200 if index % 3 == 2 else None])

    def stream_damaged(self) -> Iterator[bytes]:
        yield from self._pictures(PICTURES_BEFORE_TROUBLE)
        yield from self._pictures(make=lambda index: picture(index)[:-200])

    def stream_lying(self) -> Iterator[bytes]:
        """Claim 100 bytes too few for each picture after the first ones."""
        yield from self._pictures(PICTURES_BEFORE_TROUBLE)
        yield from self._pictures(length=lambda jpeg: len(jpeg) - 100)

    def answer_dashes(self) -> None:
        """Announce the boundary with its dashes, as many cameras do."""
        self._send(self._pictures(boundary="my.frame"), "boundary=--my.frame")

    def answer_quoted(self) -> None:
        self._send(self._pictures(boundary="a:b c"), 'boundary="a:b c"')

    def answer_unannounced(self) -> None:
        """Use another boundary than announced."""
        self._send(self._pictures(boundary="other"), "boundary=frame")

    def answer_snapshot(self) -> None:
        self._whole("image/jpeg", picture(0))

    def answer_recording(self) -> None:
        self._whole("video/x-matroska", self.camera.recording)

    def answer_page(self) -> None:
        self._whole("text/html", b"<html><body>Log in first</body></html>" * 100)

    def answer_locked(self) -> None:
        expected = base64.b64encode(f"{USER}:{PASSWORD}".encode()).decode()
        if self.headers.get("Authorization") == f"Basic {expected}":
            self._send(self._pictures())
            return
        self.send_response(401)
        self.send_header("WWW-Authenticate", 'Basic realm="camera"')
        self.end_headers()

    def answer_broken(self) -> None:
        self.send_error(500)

    def answer_silent(self) -> None:
        self.camera.stopped.wait()

    def _whole(self, kind: str, body: bytes) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)
