"""The delay of a network camera, from the picture to its pixels, beside ffmpeg and GStreamer.

An RTSP server gets numbered pictures through a pipe and sends them as H.264. Each reader gets them
over TCP from a server of its own; the delay ends when it has the pixels, of which it reads the
number. It includes the server's encoder, which is the same for all.
"""

from __future__ import annotations

import shutil
import statistics
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tests.support.pictures.frame_numbers import read_number
from zv.camera.sources.url import UrlOptions, open_url
from zv.camera.synthetic.frame_code import draw_number

WIDTH, HEIGHT, RATE_HZ = 640, 480, 30
FRAME_BYTES: Final = WIDTH * HEIGHT * 3
PYTHON: Final = "/usr/bin/python3"
SERVER: Final = f"""
import sys, threading
import gi
gi.require_version("Gst", "1.0"); gi.require_version("GstRtspServer", "1.0")
from gi.repository import GLib, Gst, GstRtspServer
Gst.init(None)
server = GstRtspServer.RTSPServer()
server.set_address("127.0.0.1"); server.set_service("0")
factory = GstRtspServer.RTSPMediaFactory()
factory.set_launch("( appsrc name=in is-live=true do-timestamp=true format=time "
    "caps=video/x-raw,format=BGR,width={WIDTH},height={HEIGHT},framerate={RATE_HZ}/1 "
    "! videoconvert ! video/x-raw,format=I420 "
    "! x264enc tune=zerolatency speed-preset=ultrafast key-int-max=30 bitrate=8000 "
    "! rtph264pay name=pay0 config-interval=1 )")
inputs = []
def configure(_factory, media):
    inputs[:] = [media.get_element().get_by_name_recurse_up("in")]
factory.connect("media-configure", configure)
def feed():
    while len(data := sys.stdin.buffer.read({FRAME_BYTES})) == {FRAME_BYTES}:
        for each in inputs:
            each.emit("push-buffer", Gst.Buffer.new_wrapped(data))
threading.Thread(target=feed, daemon=True).start()
server.get_mount_points().add_factory("/numbered", factory)
server.attach(None)
print(server.get_bound_port(), flush=True)
GLib.MainLoop().run()
"""

Pixels = NDArray[np.uint8]


def why_not() -> str:
    """Return why there can be no server; empty if there can."""
    needs = 'import gi; gi.require_version("GstRtspServer", "1.0")'
    if not shutil.which(PYTHON) or subprocess.run([PYTHON, "-c", needs], check=False).returncode:
        return "it needs Debian's gir1.2-gst-rtsp-server-1.0 and python3-gi"
    return ""


def measure(seconds: float) -> dict[str, Any]:
    """Return the delays of each reader that is installed, ms."""
    readers: dict[str, Callable[[str], Iterator[Pixels]]] = {"zv camera's source": _of_zv}
    if shutil.which("ffmpeg"):
        readers["ffmpeg, nobuffer"] = _of_ffmpeg
    if shutil.which("gst-launch-1.0"):
        readers["GStreamer, latency=0"] = _of_gstreamer
    return {name: _delays(reader, seconds) for name, reader in readers.items()}


def _delays(reader: Callable[[str], Iterator[Pixels]], seconds: float) -> dict[str, float]:
    written_s: dict[int, float] = {}
    delays_ms: list[float] = []
    with _server(written_s) as url:
        pictures, end_s = reader(url), None
        for pixels in pictures:
            at_s = time.monotonic()
            end_s = end_s or at_s + seconds + 1
            number = read_number(pixels)
            if number in written_s and at_s > end_s - seconds:  # the first second starts it up
                delays_ms.append(1e3 * (at_s - written_s[number]))
            if at_s > end_s:
                break
        pictures.close()  # type: ignore[attr-defined]
    if not delays_ms:
        raise RuntimeError("the reader delivered no picture with a number")
    ordered = sorted(delays_ms)
    return {
        "pictures": len(ordered),
        "p50_ms": round(statistics.median(ordered), 1),
        "p99_ms": round(ordered[len(ordered) * 99 // 100], 1),
    }


@contextmanager
def _server(written_s: dict[int, float]) -> Iterator[str]:
    """Run a server with numbered pictures; notes when each was written to it."""
    server = subprocess.Popen(
        [PYTHON, "-c", SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
    )
    assert server.stdin is not None
    assert server.stdout is not None
    stopped = threading.Event()

    def write() -> None:
        scene = np.random.default_rng(1).integers(60, 200, (HEIGHT // 8, WIDTH // 8, 3), np.uint8)
        scene = np.ascontiguousarray(np.repeat(np.repeat(scene, 8, 0), 8, 1))
        begun_s = time.monotonic()
        for number in range(1 << 16):
            if stopped.wait(max(0.0, begun_s + number / RATE_HZ - time.monotonic())):
                return
            draw_number(scene, number)
            written_s[number] = time.monotonic()
            try:
                server.stdin.write(scene.tobytes())  # type: ignore[union-attr]
            except OSError:
                return

    try:
        url = f"rtsp://127.0.0.1:{int(server.stdout.readline())}/numbered"
        threading.Thread(target=write, daemon=True).start()
        yield url
    finally:
        stopped.set()
        server.kill()
        server.wait()


def _of_zv(url: str) -> Iterator[Pixels]:
    source = open_url(url, UrlOptions(timeout_s=10, transport="tcp", hwaccel="none"))
    try:
        while (timed := source.read()) is not None:
            yield np.asarray(timed.picture.pixels, np.uint8)
    finally:
        source.close()


def _of_ffmpeg(url: str) -> Iterator[Pixels]:
    yield from _of_program(
        *("ffmpeg", "-v", "error", "-rtsp_transport", "tcp", "-fflags", "nobuffer"),
        *("-flags", "low_delay", "-probesize", "32", "-analyzeduration", "0", "-i", url),
        *("-f", "rawvideo", "-pix_fmt", "bgr24", "-fps_mode", "passthrough", "-"),
    )


def _of_gstreamer(url: str) -> Iterator[Pixels]:
    yield from _of_program(
        *("gst-launch-1.0", "-q", "rtspsrc", f"location={url}", "protocols=tcp", "latency=0", "!"),
        *("decodebin", "!", "videoconvert", "!", "video/x-raw,format=BGR", "!"),
        *("fdsink", "sync=false"),
    )


def _of_program(*words: str) -> Iterator[Pixels]:
    program = subprocess.Popen(words, stdout=subprocess.PIPE, bufsize=FRAME_BYTES)
    assert program.stdout is not None
    try:
        while len(data := program.stdout.read(FRAME_BYTES)) == FRAME_BYTES:
            yield np.frombuffer(data, np.uint8).reshape(HEIGHT, WIDTH, 3)
    finally:
        program.kill()
        program.wait()
