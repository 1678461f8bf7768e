"""A real MJPEG camera over HTTP, on a free port of the loopback interface, with bad manners.

Its paths are its manners: those of ``STREAMS``, and the methods ``answer_...``. Picture i is plain
grey of level ``level(i)``.
"""

from __future__ import annotations

import base64
import hashlib
import itertools
import re
import threading
import time
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


def pictures(
    count: int | None = None,
    make: Callable[[int], bytes] = picture,
    length: Callable[[bytes], int | None] = len,
    boundary: str = "frame",
) -> Iterator[bytes]:
    """Yield the parts of a stream, by default without end."""
    for index in itertools.count() if count is None else range(count):
        jpeg = make(index)
        size = length(jpeg)
        sized = "" if size is None else f"Content-Length: {size}\r\n"
        head = f"--{boundary}\r\nContent-Type: image/jpeg\r\n{sized}\r\n"
        yield head.encode() + jpeg + b"\r\n"


def then(trouble: Callable[[], Iterator[bytes]], **how: Any) -> Callable[[], Iterator[bytes]]:
    """Return a stream of a few pictures, and what follows."""
    return lambda: itertools.chain(pictures(PICTURES_BEFORE_TROUBLE, **how), trouble())


UNSIZED: dict[str, Any] = {"length": lambda _: None}
STREAMS: dict[str, Callable[[], Iterator[bytes]]] = {
    "sized": pictures,
    "unsized": lambda: pictures(**UNSIZED),
    "tables_missing": lambda: pictures(make=lambda n: without_huffman_tables(picture(n))),
    "padded": lambda: pictures(make=lambda n: picture(n) + bytes(64)),
    "repeating": lambda: pictures(make=lambda _: picture(0)),
    "hanging_up": lambda: pictures(PICTURES_BEFORE_TROUBLE),
    "cut": then(lambda: iter([next(pictures())[:-200]])),
    "dripping": then(lambda: (bytes([byte]) for byte in next(pictures()) * 10)),
    "damaged": then(lambda: pictures(make=lambda n: picture(n)[:-200])),
    # Every third picture is cut short.
    "hiccuping": lambda: pictures(make=lambda n: picture(n)[: -200 if n % 3 == 2 else None]),
    # 100 bytes too few are claimed for each picture.
    "lying": lambda: pictures(length=lambda jpeg: len(jpeg) - 100),
    "boundary_after": lambda: (part[9:] + b"--frame\r\n" for part in pictures()),
}


class HttpCamera:
    """The camera; a context manager.

    Attributes:
        rate_hz: How fast it sends.
        files: Further files that it has, by name.
        asked_s: When ``/snapshot`` was asked for, monotonic.
        challenge: How ``/challenging`` asks for a password.
        recording: What ``/recording`` is: the bytes of a video file.
    """

    def __init__(self, rate_hz: float = 50.0) -> None:
        self.rate_hz = rate_hz
        self.recording = b""
        self.challenge = ""
        self.asked_s: list[float] = []
        self.files: dict[str, bytes] = {}
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


def _md5(text: str) -> str:
    return hashlib.md5(text.encode()).hexdigest()


class _Handler(BaseHTTPRequestHandler):
    camera: ClassVar[HttpCamera]

    def do_GET(self) -> None:
        name = self.path.partition("?")[0].strip("/")
        answer = getattr(self, f"answer_{name}", None)
        try:
            if answer is not None:
                answer()
            elif name in self.camera.files:
                self._whole("application/octet-stream", self.camera.files[name])
            elif name in STREAMS:
                self._send(STREAMS[name]())
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

    def answer_stalling(self) -> None:
        self._send(pictures(PICTURES_BEFORE_TROUBLE))
        self.camera.stopped.wait()

    def answer_held_back(self) -> None:
        """Send nothing for a while, and then what was to be sent meanwhile, at once."""
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        parts = list(pictures(3 * PICTURES_BEFORE_TROUBLE))
        for part in parts[:PICTURES_BEFORE_TROUBLE]:
            self.wfile.write(part)
            self.camera.stopped.wait(0.02)
        self.camera.stopped.wait(0.8)
        self.wfile.write(b"".join(parts[PICTURES_BEFORE_TROUBLE:]))
        self.camera.stopped.wait()

    def answer_endless(self) -> None:
        """Send a picture that has no end, as fast as it goes."""
        self._send(pictures(PICTURES_BEFORE_TROUBLE, **UNSIZED))
        self._flood(next(pictures(**UNSIZED))[:-20])

    def answer_endless_jpeg(self) -> None:
        """Send a bare JPEG that has no end."""
        self.send_response(200)
        self.send_header("Content-Type", "image/jpeg")
        self.end_headers()
        self._flood(picture(0)[:-20])

    def _flood(self, begin: bytes) -> None:
        self.wfile.write(begin)
        while not self.camera.stopped.is_set():
            self.wfile.write(bytes(1 << 20))

    def answer_dashes(self) -> None:
        """Announce the boundary with its dashes, as many cameras do."""
        self._send(pictures(boundary="my.frame"), "boundary=--my.frame")

    def answer_quoted(self) -> None:
        self._send(pictures(boundary="a:b c"), 'boundary="a:b c"')

    def answer_unannounced(self) -> None:
        """Use another boundary than announced."""
        self._send(pictures(boundary="other"), "boundary=frame")

    def answer_snapshot(self) -> None:
        """Send one picture, the next one each time."""
        self.camera.asked_s.append(time.monotonic())
        self._whole("image/jpeg", picture(len(self.camera.asked_s) - 1))

    def answer_octets(self) -> None:
        """Send bare JPEGs, one after the other."""
        self.send_response(200)
        self.send_header("Content-Type", "application/octet-stream")
        self.end_headers()
        for index in itertools.count():
            self.wfile.write(picture(index))
            if self.camera.stopped.wait(1.0 / self.camera.rate_hz):
                return

    def answer_digest(self) -> None:
        """Ask for the password by digest access authentication, RFC 2617, MD5."""
        fields = dict(re.findall(r'(\w+)="?([^",]+)', self.headers.get("Authorization", "")))
        secret = _md5(f"{USER}:camera:{PASSWORD}")
        path = _md5(f"GET:{fields.get('uri', '')}")
        middle = [fields.get(name, "") for name in ("nonce", "nc", "cnonce", "qop")]
        if fields.get("response") == _md5(":".join([secret, *middle, path])):
            self._send(pictures())
            return
        self.send_response(401)
        self.send_header("WWW-Authenticate", 'Digest realm="camera", nonce="n1", qop="auth"')
        self.end_headers()

    def answer_challenging(self) -> None:
        self.send_response(401)
        self.send_header("WWW-Authenticate", self.camera.challenge)
        self.end_headers()

    def _drip(self, begin: bytes, drop: bytes = b"0") -> None:
        """Send the begin of an answer, and then a byte now and then, without end."""
        self.wfile.write(begin)
        while not self.camera.stopped.wait(0.05):
            self.wfile.write(drop)

    def answer_dripped_header(self) -> None:
        self._drip(b"HTTP/1.1 200 OK\r\nX-Long: ")

    def answer_dripped_redirect(self) -> None:
        self._drip(b"HTTP/1.1 302 Found\r\nLocation: /sized\r\nContent-Length: 9999\r\n\r\n")

    def answer_dripped_picture(self) -> None:
        self._drip(b"HTTP/1.1 200 OK\r\nContent-Type: image/jpeg\r\n\r\n" + picture(0)[:-20])

    def answer_dripped_chunk_size(self) -> None:
        self._drip(
            b"HTTP/1.1 200 OK\r\nContent-Type: image/jpeg\r\nTransfer-Encoding: chunked\r\n\r\n"
        )

    def answer_dripped_page(self) -> None:
        self._drip(b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n")

    def answer_first_whole(self) -> None:
        """Send a picture, and from the second time on one that has no end."""
        self.camera.asked_s.append(time.monotonic())
        if len(self.camera.asked_s) == 1:
            self._whole("image/jpeg", picture(0))
        else:
            self.answer_dripped_picture()

    def answer_recording(self) -> None:
        self._whole("video/x-matroska", self.camera.recording)

    def answer_page(self) -> None:
        self._whole("text/html", b"<html><body>Log in first</body></html>" * 100)

    def answer_locked(self) -> None:
        expected = base64.b64encode(f"{USER}:{PASSWORD}".encode()).decode()
        if self.headers.get("Authorization") == f"Basic {expected}":
            self._send(pictures())
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
