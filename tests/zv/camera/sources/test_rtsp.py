"""A real RTSP server on the loopback interface, behind networks that hold back what it sends."""

from __future__ import annotations

import itertools
import re
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path

import pytest
from av.codec.hwaccel import HWAccel

from tests.support.pictures.url_sources import PATIENT_S, SHORT_S, SLACK_S, Opened, read_until_lost
from tests.support.pictures.videos import decoded, shown
from tests.support.processes import missing, need
from tests.support.programs import rtsp_camera
from zenoh_vision.errors import SourceError, SourceLost
from zv.camera.sources import url
from zv.camera.sources.base import TimedPicture
from zv.camera.sources.libav import VideoDecoder
from zv.camera.sources.libav_options import Hardware

RTSP_SERVER = Path(rtsp_camera.__file__)
SYSTEM_PYTHON = "/usr/bin/python3"
UNAVAILABLE = 69


class RtspCamera:
    """The server of ``rtsp_camera.py`` in a process of its own."""

    def __init__(self, port: int = 0) -> None:
        self.process = subprocess.Popen(
            [need(SYSTEM_PYTHON, "python3"), str(RTSP_SERVER), "127.0.0.1", str(port)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        port = self.process.stdout.readline().strip()
        if not port:
            _, errors = self.process.communicate(timeout=10)
            if self.process.returncode == UNAVAILABLE:
                missing(f"no GStreamer RTSP server: {errors.strip()}; see rtsp_camera.py")
            pytest.fail(f"the RTSP server did not start: {errors}")
        self.port = int(port)

    def url(self, path: str, credentials: str = "") -> str:
        return f"rtsp://{credentials}127.0.0.1:{self.port}{path}"

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def close(self) -> None:
        self.process.kill()
        self.process.communicate(timeout=10)


@pytest.fixture(scope="module")
def shared_rtsp() -> Iterator[RtspCamera]:
    with closing(RtspCamera()) as server:
        yield server


@pytest.mark.parametrize(("path", "codec"), [("/h264", "H264"), ("/h265", "HEVC")])
def test_a_codec_over_rtsp_is_decoded(
    shared_rtsp: RtspCamera, opened: Opened, path: str, codec: str
):
    source = opened(shared_rtsp.url(path))
    assert source.live
    assert source.description == f"{shared_rtsp.url(path)} (320x240, {codec})"
    given = [source.read() for _ in range(10)]
    assert {shown(each).shape for each in given} == {(240, 320, 3)}
    assert all((shown(one) != shown(other)).any() for one, other in itertools.pairwise(given)), (
        "the ball moves in each picture"
    )


def test_mjpeg_over_rtsp_comes_through_undecoded_with_its_tables(
    shared_rtsp: RtspCamera, opened: Opened
):
    jpeg = opened(shared_rtsp.url("/mjpeg")).read().picture.data
    assert b"\xff\xc4" in jpeg
    assert decoded(jpeg).shape == (240, 320, 3)


@pytest.mark.parametrize(
    ("path", "credentials", "reason"),
    [
        ("/nothing", "", r"no such path \(404\)"),
        ("/locked", "", r"\(401\)"),
        ("/locked", "viewer:hidden@", r"\(401\)"),
    ],
    ids=["no such path", "no password", "wrong password"],
)
def test_a_refusal_over_rtsp_is_said_in_words(
    shared_rtsp: RtspCamera, opened: Opened, path: str, credentials: str, reason: str
):
    with pytest.raises(SourceError, match=reason) as caught:
        opened(shared_rtsp.url(path, credentials))
    assert "hidden" not in str(caught.value)


@pytest.mark.parametrize(
    ("credentials", "settings"),
    [("viewer:secret@", {}), ("", {"username": "viewer", "password": "secret"})],
    ids=["in the URL", "of the settings"],
)
def test_the_right_password_opens_an_rtsp_camera_and_is_not_shown(
    shared_rtsp: RtspCamera, opened: Opened, credentials: str, settings: dict[str, str]
):
    source = opened(shared_rtsp.url("/locked", credentials), **settings)
    assert source.read() is not None
    assert "secret" not in source.description


def test_an_rtsp_camera_that_stalls_is_lost_in_time_and_opens_again_when_it_is_back(opened: Opened):
    with closing(RtspCamera()) as server:
        source = opened(server.url("/h264"), SHORT_S)
        source.read()
        server.signal(signal.SIGSTOP)
        _, lost, waited_s = read_until_lost(source)
        assert "no usable picture from the server for 1 s" in lost
        assert waited_s < SHORT_S + SLACK_S
        with pytest.raises(SourceError, match="no usable picture from the server"):
            opened(server.url("/h264"), SHORT_S)
        server.signal(signal.SIGCONT)
        assert opened(server.url("/h264")).read() is not None


def test_a_connection_whose_other_end_is_gone_without_a_word_is_lost_and_closed_in_time(
    network: Network, opened: Opened
):
    source = opened(f"rtsp://127.0.0.1:{network.port}/h264", SHORT_S)
    source.read()
    network.passes.clear()
    _, lost, waited_s = read_until_lost(source)
    assert "no usable picture from the server for 1 s" in lost
    assert waited_s < SHORT_S + SLACK_S
    started_s = time.monotonic()
    source.close()
    assert time.monotonic() - started_s < SHORT_S + SLACK_S


def age_s(timed: TimedPicture) -> float:
    return (time.time_ns() - timed.stamp_ns) / 1e9


class Network:
    """Passes a connection on to a port, unless it is held; ``change`` sees what is asked."""

    def __init__(self, port: int, change: Callable[[bytes], bytes] = lambda data: data) -> None:
        self._change = change
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self._to = port
        self.passes = threading.Event()
        self.passes.set()
        self._open: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._server.accept()
            except OSError:
                return
            far = socket.create_connection(("127.0.0.1", self._to))
            self._open += [near, far]
            for source, target, change in ((near, far, self._change), (far, near, bytes)):
                ends = (source, target, change)
                threading.Thread(target=self._pass, args=ends, daemon=True).start()

    def _pass(
        self, source: socket.socket, target: socket.socket, change: Callable[[bytes], bytes]
    ) -> None:
        with suppress(OSError):
            while data := source.recv(1 << 16):
                self.passes.wait()
                target.sendall(change(data))
            target.shutdown(socket.SHUT_RDWR)

    def hold(self, seconds: float) -> None:
        self.passes.clear()
        threading.Event().wait(seconds)  # the length of the stall is what is tested
        self.passes.set()

    def close(self) -> None:
        self.passes.set()
        for each in (self._server, *self._open):
            with suppress(OSError):  # the other end has closed it
                # A thread that waits in a call on it would keep it open.
                each.shutdown(socket.SHUT_RDWR)
            each.close()


@pytest.fixture
def network(shared_rtsp: RtspCamera) -> Iterator[Network]:
    with closing(Network(shared_rtsp.port)) as found:
        yield found


@pytest.mark.quiet
@pytest.mark.parametrize("path", ["/h264", "/mjpeg"])
def test_what_the_network_held_back_for_3_s_is_as_old_as_it_is_and_skipped(
    network: Network, opened: Opened, path: str
):
    source = opened(f"rtsp://127.0.0.1:{network.port}{path}")
    usual = [(picture, age_s(picture)) for picture in (source.read() for _ in range(20))]
    assert sorted(age for _, age in usual)[10] < 0.2
    begun_s = time.monotonic()
    network.hold(3.0)
    given, young = [], 0
    while young < 30:  # in a row: a busy machine may be late once more
        assert len(given) < 300
        given.append(source.read())
        young = young + 1 if age_s(given[-1]) < 0.3 else 0
    took_s = time.monotonic() - begun_s
    stamps = [picture.stamp_ns for picture in given]
    assert stamps == sorted(set(stamps))
    # 90 pictures in 3 s, of which those until a key picture are shown. Those that are missing by
    # their stamps are counted.
    skipped = sum(picture.skipped for picture in given)
    assert 60 < skipped < 30 * took_s - len(given) + 3
    missing = round((stamps[-1] - usual[-1][0].stamp_ns) / 1e9 * 30) - len(stamps)
    assert skipped == pytest.approx(missing, abs=2)
    # Beside the gap of what was skipped, the pictures are as far apart as the camera took them.
    gaps = sorted((after - before) / 1e9 for before, after in itertools.pairwise(stamps))
    assert gaps[len(gaps) // 2] == pytest.approx(1 / 30, abs=0.01)


@pytest.mark.quiet
def test_without_a_limit_nothing_is_skipped_and_stamps_are_true(network: Network, opened: Opened):
    source = opened(f"rtsp://127.0.0.1:{network.port}/h264", max_lag_s=lambda: 0.0)
    for _ in range(10):
        source.read()
    network.hold(1.5)
    given = [(picture, age_s(picture)) for picture in (source.read() for _ in range(60))]
    assert sum(picture.skipped for picture, _ in given) == 0
    assert max(age for _, age in given) > 1.0


@pytest.mark.alone
def test_a_slow_decoder_shows_the_newest_key_picture(
    shared_rtsp: RtspCamera, opened: Opened, monkeypatch: pytest.MonkeyPatch
):
    decode = VideoDecoder.decode

    def slowly(decoder: VideoDecoder, packet: object) -> Iterator[object]:
        threading.Event().wait(0.1)  # 10 Hz, of 30
        yield from decode(decoder, packet)

    monkeypatch.setattr(VideoDecoder, "decode", slowly)
    source = opened(shared_rtsp.url("/h264"))
    given = [(picture, age_s(picture)) for picture in (source.read() for _ in range(30))]
    assert sum(picture.skipped for picture, _ in given) > 30
    # A key picture each half second: what is shown is at most that much older than the limit.
    assert max(age for _, age in given[10:]) < 0.5 + 0.5 + 0.3


def test_an_rtsp_camera_that_dies_is_lost_at_once_and_opened_again_when_it_is_back(opened: Opened):
    first = RtspCamera()
    source = opened(first.url("/h264"))
    source.read()
    first.close()
    _, lost, waited_s = read_until_lost(source)
    assert waited_s < SLACK_S
    assert first.url("/h264") in lost
    with pytest.raises(SourceError, match="nobody listens there"):
        opened(first.url("/h264"))
    with closing(RtspCamera(first.port)) as again:
        assert age_s(opened(again.url("/h264")).read()) < 1.0


@pytest.mark.parametrize(
    ("path", "transport"), [("/h264", "auto"), ("/h264", "udp"), ("/udp", "udp"), ("/udp", "auto")]
)
def test_rtsp_goes_over_tcp_or_udp(
    shared_rtsp: RtspCamera, opened: Opened, path: str, transport: str
):
    assert opened(shared_rtsp.url(path), transport=transport).read() is not None


@pytest.mark.quiet
@pytest.mark.parametrize("transport", ["tcp", "udp"])
@pytest.mark.parametrize("path", ["/h264", "/h265", "/mjpeg"])
def test_lost_packets_are_counted_and_no_picture_that_they_damage_is_shown(
    shared_rtsp: RtspCamera, opened: Opened, path: str, transport: str
):
    def unlimited() -> float:
        return 0.0

    whole = opened(shared_rtsp.url(f"{path}/whole"), max_lag_s=unlimited)
    lossy = opened(shared_rtsp.url(f"{path}/lossy"), transport=transport, max_lag_s=unlimited)
    given, end_s = [lossy.read() for _ in range(60)], time.monotonic() + PATIENT_S
    while sum(picture.packets_lost for picture in given) < 3 and time.monotonic() < end_s:
        given.append(lossy.read())
    assert sum(picture.packets_lost for picture in given) >= 3
    assert sum(picture.lost for picture in given) > 0 or path == "/mjpeg"
    # Both got the same pictures from the first; bit for bit, since decoding is exact.
    wanted, end_s = {shown(picture).tobytes() for picture in given}, time.monotonic() + PATIENT_S
    while wanted and time.monotonic() < end_s:
        wanted.discard(shown(whole.read()).tobytes())
    assert not wanted


def test_udp_that_a_firewall_stops_is_said_in_time(shared_rtsp: RtspCamera, opened: Opened):
    def divert(request: bytes) -> bytes:
        return re.sub(rb"client_port=[0-9-]+", b"client_port=9-10", request)

    with closing(Network(shared_rtsp.port, divert)) as firewall:
        address = f"rtsp://127.0.0.1:{firewall.port}/h264"
        assert opened(address).read() is not None  # auto: by TCP
        started_s = time.monotonic()
        with pytest.raises(
            (SourceError, SourceLost), match="for 1 s; nothing came by UDP, which a"
        ):
            opened(address, SHORT_S, transport="udp").read()
        assert time.monotonic() - started_s < SHORT_S + SLACK_S


@pytest.mark.parametrize(
    ("found", "why"),
    [
        (None, "no hardware decoder works here"),
        (Hardware("drm", HWAccel("drm", allow_software_fallback=True)), "drm cannot"),
    ],
    ids=["no hardware", "hardware for other codecs"],
)
def test_what_no_hardware_decodes_the_cpu_does_and_a_line_says_so(
    shared_rtsp: RtspCamera,
    opened: Opened,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    found: Hardware | None,
    why: str,
):
    monkeypatch.setattr(url, "hardware", lambda _wanted: found)
    with caplog.at_level("INFO"):
        assert opened(shared_rtsp.url("/h264"), hwaccel="auto").read() is not None
    assert f"H264 is decoded by the CPU: {why}" in caplog.text


def test_a_transport_that_the_server_refuses_is_said(shared_rtsp: RtspCamera, opened: Opened):
    with pytest.raises(SourceError, match="refuses this transport of RTSP; set rtsp_transport"):
        opened(shared_rtsp.url("/udp"), transport="tcp")
