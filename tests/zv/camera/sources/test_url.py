"""Network cameras, real ones on the loopback interface: good, badly behaved, and gone."""

from __future__ import annotations

import contextlib
import itertools
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.support.pictures import http_camera
from tests.support.pictures.http_camera import PICTURES_BEFORE_TROUBLE, HttpCamera, level
from tests.support.pictures.videos import decoded, make_video, shown
from tests.support.processes import environment, missing, need
from tests.support.programs import rtsp_camera
from zenoh_vision.errors import SourceError, SourceLost
from zv.camera.sources.base import KnowsNextDue, Source, TimedPicture
from zv.camera.sources.libav import VideoDecoder
from zv.camera.sources.url import UrlOptions, open_url

RTSP_SERVER = Path(rtsp_camera.__file__)
SYSTEM_PYTHON = "/usr/bin/python3"
UNAVAILABLE = 69
SHORT_S = 1.0
PATIENT_S = 30.0
SLACK_S = 20.0
"""What a busy machine may take; less than ``PATIENT_S``, or the time allowed would not count."""


@pytest.fixture(autouse=True)
def _no_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("http_proxy", raising=False)


@pytest.fixture
def camera() -> Iterator[HttpCamera]:
    with HttpCamera() as running:
        yield running


def opened(url: str, timeout_s: float = PATIENT_S) -> Source:
    """Open a camera, without hardware for it."""
    return open_url(url, UrlOptions(timeout_s=timeout_s, hwaccel="none"))


def grey(timed: TimedPicture) -> float:
    """Return the mean grey level of a picture that came as a JPEG."""
    return float(decoded(timed.picture.data).mean())


def read_until_lost(source: Source) -> tuple[list[TimedPicture], str, float]:
    """Return the pictures, why there are no more, and how long the last wait was, seconds."""
    pictures: list[TimedPicture] = []
    try:
        while True:
            started_s = time.monotonic()
            picture = source.read()
            assert picture is not None, "a camera never ends regularly"
            pictures.append(picture)
    except SourceLost as lost:
        return pictures, str(lost), time.monotonic() - started_s
    finally:
        source.close()


@pytest.mark.parametrize(
    "manner",
    [
        *("sized", "unsized", "padded", "tables_missing", "dashes", "quoted", "unannounced"),
        *("lying", "boundary_after", "octets"),
    ],
)
def test_each_picture_comes_once_in_order_and_undecoded(camera: HttpCamera, manner: str):
    source = opened(camera.url(f"/{manner}"))
    given = [source.read() for _ in range(12)]
    source.close()
    assert [grey(picture) for picture in given] == pytest.approx(
        [level(index) for index in range(12)], abs=2
    )
    assert {(each.picture.encoding, each.picture.size) for each in given} == {("bgr8", (64, 48))}
    assert all(picture.due_s is None for picture in given)


def test_a_packet_passes_byte_for_byte_and_the_camera_paces_itself(camera: HttpCamera):
    source = opened(camera.url("/sized"))
    assert source.read().picture.data == http_camera.picture(0)
    source.close()
    assert (source.live, source.rate_hz) == (True, None)
    assert source.description == f"{camera.url('/sized')} (64x48, MJPEG)"


def test_a_single_picture_is_asked_for_again_and_again(camera: HttpCamera):
    options = UrlOptions(timeout_s=PATIENT_S, rate_hz=lambda: 20.0)
    source = open_url(camera.url("/snapshot"), options)
    assert isinstance(source, KnowsNextDue)
    assert source.live
    assert source.description == f"{camera.url('/snapshot')} (64x48, a picture each 0.05 s)"
    due_s, given = [], []
    for _ in range(4):
        due_s.append(source.next_due_s())
        before_ns = time.time_ns()
        given.append(source.read())
    assert due_s == pytest.approx([0.0, 0.05, 0.1, 0.15])
    assert [grey(each) for each in given] == pytest.approx([level(k) for k in range(4)], abs=2)
    assert before_ns <= given[-1].stamp_ns <= time.time_ns()
    source.close()


def test_pictures_that_are_cut_short_are_left_out(camera: HttpCamera):
    source = opened(camera.url("/hiccuping"))
    given = [grey(source.read()) for _ in range(6)]
    source.close()
    assert given == pytest.approx([level(index) for index in (0, 1, 3, 4, 6, 7)], abs=2)


@pytest.mark.parametrize(
    ("manner", "reason"),
    [
        ("hanging_up", "the server ended the stream"),
        ("cut", "the server ended the stream"),
    ],
)
def test_a_server_that_breaks_off_is_lost_after_its_last_good_picture(
    camera: HttpCamera, manner: str, reason: str
):
    given, lost, _ = read_until_lost(opened(camera.url(f"/{manner}")))
    assert len(given) == PICTURES_BEFORE_TROUBLE
    assert reason in lost
    assert camera.url(f"/{manner}") in lost


@pytest.mark.parametrize("manner", ["stalling", "dripping", "damaged"])
def test_a_server_without_new_pictures_is_lost_in_the_time_allowed(camera: HttpCamera, manner: str):
    source = opened(camera.url(f"/{manner}"), SHORT_S)
    given, lost, waited_s = read_until_lost(source)
    assert len(given) == PICTURES_BEFORE_TROUBLE
    assert f"no usable picture from the server for {SHORT_S:g} s" in lost
    # The time counts from the arrival of the last picture, a moment before it was returned.
    assert (time.time_ns() - given[-1].stamp_ns) / 1e9 >= SHORT_S
    assert waited_s < SHORT_S + SLACK_S


ENDLESS = """
import sys
from zenoh_vision.errors import SourceError
from zv.camera.sources.url import UrlOptions, open_url
try:
    source = open_url(sys.argv[1], UrlOptions(timeout_s=float(sys.argv[2])))
    while True:
        source.read()
except SourceError as error:
    print(error)
# Not ru_maxrss, which a process inherits from the one that started it.
print(open("/proc/self/status").read().partition("VmHWM:")[2].split()[0])
"""


@pytest.mark.parametrize(
    ("manner", "timeout_s", "reason"),
    [
        ("endless", 30, "far too large, or has no end"),
        ("endless_jpeg", 30, "far too large, or has no end"),
    ],
)
def test_a_picture_without_an_end_is_given_up_before_it_takes_the_memory(
    camera: HttpCamera, manner: str, timeout_s: int, reason: str
):
    run = [sys.executable, "-c", ENDLESS, camera.url(f"/{manner}"), str(timeout_s)]
    said, peak_kb = subprocess.run(
        run, capture_output=True, text=True, check=True, timeout=60, env=environment()
    ).stdout.splitlines()
    assert re.search(reason, said)
    assert int(peak_kb) * 1024 < 400e6  # a block grows by copying: twice the limit, and the program


@pytest.mark.parametrize("scheme", ["http", "rtsp"])
def test_a_port_that_accepts_and_then_says_nothing_ends_in_the_time_allowed(scheme: str):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        started_s = time.monotonic()
        with pytest.raises(SourceError, match="no usable picture from the server"):
            open_url(
                f"{scheme}://127.0.0.1:{listener.getsockname()[1]}/", UrlOptions(timeout_s=SHORT_S)
            )
        assert time.monotonic() - started_s < SHORT_S + SLACK_S


@pytest.mark.parametrize("scheme", ["http", "rtsp"])
def test_a_port_without_a_listener_is_an_error(scheme: str):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(SourceError, match="nobody listens there"):
        opened(f"{scheme}://127.0.0.1:{port}/")


@pytest.mark.parametrize(
    ("manner", "reason"),
    [
        ("nothing_here", r"no such path \(404\)"),
        ("locked", r"\(401\)"),
        ("broken", r"failed \(500\)"),
        ("page", "no video"),
    ],
)
def test_a_refusal_is_said_in_words(camera: HttpCamera, manner: str, reason: str):
    with pytest.raises(SourceError, match=reason) as caught:
        opened(camera.url(f"/{manner}"))
    assert not isinstance(caught.value, SourceLost)


def test_user_and_password_in_the_url_open_the_camera_and_are_not_shown(camera: HttpCamera):
    url = camera.url("/locked", f"{http_camera.USER}:{http_camera.PASSWORD}@")
    source = opened(url)
    source.read()
    source.close()
    assert http_camera.PASSWORD not in source.description
    assert http_camera.USER not in source.description
    assert "***@127.0.0.1" in source.description


@pytest.mark.parametrize("path", ["/locked", "/nothing_here", "/page", "/silent", "/hanging_up"])
def test_no_error_shows_the_password(camera: HttpCamera, path: str):
    url = camera.url(f"{path}?token=hidden-token", "someone:hidden-word@")
    with pytest.raises(SourceError) as caught:
        read_until_lost_or_raise(opened(url, SHORT_S))
    shown = f"{caught.value!r} {caught.value.__cause__!r} {caught.value.args}"
    assert "hidden" not in shown
    assert "someone" not in shown
    error = caught.value
    assert (
        error.__suppress_context__ or error.__context__ is None
    )  # or a traceback would print libav's own error


def read_until_lost_or_raise(source: Source) -> None:
    try:
        while source.read() is not None:
            pass
    finally:
        source.close()


def test_after_a_pause_of_the_reader_the_newest_picture_comes_and_tells_its_age(camera: HttpCamera):
    camera.rate_hz = 50.0
    source = opened(camera.url("/sized"))
    first = source.read()
    threading.Event().wait(1.0)  # the pause itself is what is tested: 50 pictures pile up
    read_ns = time.time_ns()
    after = source.read()
    source.close()
    index = round((grey(after) - level(0)) / 10)
    passed = 1 + after.skipped
    assert passed > 10
    assert index == passed % 20
    assert (after.stamp_ns - first.stamp_ns) / 1e9 > 0.5
    assert (read_ns - after.stamp_ns) / 1e9 < 0.5


def test_after_a_pause_of_the_server_only_the_newest_of_what_comes_at_once_is_shown(
    camera: HttpCamera,
):
    source = opened(camera.url("/held_back"))
    given = [grey(source.read()) for _ in range(5)]
    after = source.read()
    source.close()
    assert given == pytest.approx([level(index) for index in range(5)], abs=2)
    assert (after.skipped, grey(after)) == (9, pytest.approx(level(14), abs=2))


def test_user_and_password_of_the_settings_are_sent_as_they_are(camera: HttpCamera):
    options = UrlOptions(PATIENT_S, username=http_camera.USER, password=http_camera.PASSWORD)
    for path in ("/locked", "/digest"):
        source = open_url(camera.url(path), options)
        source.read()
        source.close()
        assert source.description == f"{camera.url(path)} (64x48, MJPEG)"
        wrong = UrlOptions(PATIENT_S, username=http_camera.USER, password="hidden-word")
        with pytest.raises(SourceError, match=r"\(401\)") as caught:
            open_url(camera.url(path), wrong)
        assert "hidden" not in str(caught.value)


@pytest.mark.parametrize("mark", ["/", "?", "#"])
@pytest.mark.parametrize("scheme", ["http", "rtsp"])
def test_a_password_that_must_be_escaped_is_told_so(scheme: str, mark: str):
    with pytest.raises(SourceError, match="must be written with %2F %3F or %23") as caught:
        opened(f"{scheme}://admin:hid{mark}den@127.0.0.1:1/stream")
    assert "hid" not in str(caught.value)


def test_a_scheme_in_capitals_is_the_same(camera: HttpCamera):
    source = opened(camera.url("/sized").replace("http", "HTTP"))
    assert source.read() is not None
    source.close()


def test_a_proxy_is_named_if_the_camera_is_not_reached_through_it(monkeypatch: pytest.MonkeyPatch):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    monkeypatch.setenv("http_proxy", f"http://someone:hidden@127.0.0.1:{port}")
    with pytest.raises(SourceError) as caught:
        opened("http://192.0.2.1/stream")
    assert (
        f"nobody listens there (connection refused); it was asked for through the proxy "
        f"127.0.0.1:{port} of http_proxy: name the camera in no_proxy" in str(caught.value)
    )
    assert "hidden" not in str(caught.value)


def test_a_recording_behind_a_url_plays_at_its_own_pace_and_ends(
    camera: HttpCamera, tmp_path: Path
):
    camera.recording = make_video(tmp_path / "a.mkv", rate=10).read_bytes()
    source = opened(camera.url("/recording"))
    assert not source.live
    given = list(iter(source.read, None))
    assert [picture.due_s for picture in given] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    source.close()


def test_a_live_stream_in_segments_is_paced_by_its_presentation_times(
    camera: HttpCamera, tmp_path: Path
):
    playlist = ["#EXTM3U", "#EXT-X-VERSION:3", "#EXT-X-TARGETDURATION:1", "#EXT-X-MEDIA-SEQUENCE:7"]
    for number in range(3):
        options = {"output_ts_offset": str(1000 + number)}
        part = make_video(
            tmp_path / "a.ts", codec="mpeg2video", rate=25, frames=25, options=options
        )
        camera.files[f"{number}.ts"] = part.read_bytes()
        playlist += ["#EXTINF:1.0,", f"{number}.ts"]
    camera.files["live.m3u8"] = "\n".join([*playlist, ""]).encode()
    source = opened(camera.url("/live.m3u8"))
    assert source.live  # the list has no end
    given = [source.read() for _ in range(60)]
    source.close()
    assert [each.due_s for each in given] == pytest.approx([k / 25 for k in range(60)], abs=0.002)
    assert {each.stamp_ns for each in given} == {None}


def test_a_stream_over_tcp_is_played(tmp_path: Path):
    data = make_video(tmp_path / "a.ts", codec="mpeg2video", rate=25, frames=50).read_bytes()

    def send(listener: socket.socket) -> None:
        connection, _ = listener.accept()
        with connection, contextlib.suppress(OSError):
            connection.sendall(data)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=send, args=(listener,), daemon=True).start()
        source = opened(f"tcp://127.0.0.1:{listener.getsockname()[1]}")
        assert source.live
        assert source.read().picture.size == (64, 48)
        _, lost, _ = read_until_lost(source)
    assert "the server ended the stream" in lost


def test_a_protocol_that_libav_lacks_is_told_to_be_a_programs():
    with pytest.raises(SourceError, match=r"without this protocol; .* command:PROGRAM ARGS"):
        opened("srt://127.0.0.1:9000")


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

    def end(self) -> None:
        self.process.kill()
        self.process.communicate(timeout=10)


@pytest.fixture(scope="module")
def shared_rtsp() -> Iterator[RtspCamera]:
    server = RtspCamera()
    yield server
    server.end()


@pytest.fixture
def own_rtsp() -> Iterator[RtspCamera]:
    server = RtspCamera()
    yield server
    server.end()


@pytest.fixture
def rtsp_source() -> Iterator[Callable[..., Source]]:
    sources: list[Source] = []

    def open_it(url: str, timeout_s: float = PATIENT_S) -> Source:
        sources.append(opened(url, timeout_s))
        return sources[-1]

    yield open_it
    for source in sources:
        source.close()


Opened = Callable[..., Source]


@pytest.mark.parametrize(("path", "codec"), [("/h264", "H264"), ("/h265", "HEVC")])
def test_a_codec_over_rtsp_is_decoded(
    shared_rtsp: RtspCamera, rtsp_source: Opened, path: str, codec: str
):
    source = rtsp_source(shared_rtsp.url(path))
    assert source.live
    assert source.description == f"{shared_rtsp.url(path)} (320x240, {codec})"
    given = [source.read() for _ in range(10)]
    assert {shown(each).shape for each in given} == {(240, 320, 3)}
    assert all((shown(one) != shown(other)).any() for one, other in itertools.pairwise(given)), (
        "the ball moves in each picture"
    )


def test_mjpeg_over_rtsp_comes_through_undecoded_with_its_tables(
    shared_rtsp: RtspCamera, rtsp_source: Opened
):
    jpeg = rtsp_source(shared_rtsp.url("/mjpeg")).read().picture.data
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
    shared_rtsp: RtspCamera, path: str, credentials: str, reason: str
):
    with pytest.raises(SourceError, match=reason) as caught:
        opened(shared_rtsp.url(path, credentials))
    assert "hidden" not in str(caught.value)


def test_the_right_password_opens_an_rtsp_camera_and_is_not_shown(
    shared_rtsp: RtspCamera, rtsp_source: Opened
):
    source = rtsp_source(shared_rtsp.url("/locked", "viewer:secret@"))
    assert source.read() is not None
    assert "secret" not in source.description


def test_an_rtsp_camera_that_stalls_is_lost_in_time_and_opens_again_when_it_is_back(
    own_rtsp: RtspCamera, rtsp_source: Opened
):
    source = rtsp_source(own_rtsp.url("/h264"), SHORT_S)
    source.read()
    own_rtsp.signal(signal.SIGSTOP)
    _, lost, waited_s = read_until_lost(source)
    assert "no usable picture from the server for 1 s" in lost
    assert waited_s < SHORT_S + SLACK_S
    with pytest.raises(SourceError, match="no usable picture from the server"):
        rtsp_source(own_rtsp.url("/h264"), SHORT_S)
    own_rtsp.signal(signal.SIGCONT)
    assert rtsp_source(own_rtsp.url("/h264")).read() is not None


def age_s(timed: TimedPicture) -> float:
    return (time.time_ns() - timed.stamp_ns) / 1e9


class Network:
    """Passes a connection on to a port, unless it is held."""

    def __init__(self, port: int) -> None:
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
            for source, target in ((near, far), (far, near)):
                threading.Thread(target=self._pass, args=(source, target), daemon=True).start()

    def _pass(self, source: socket.socket, target: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(1 << 16):
                self.passes.wait()
                target.sendall(data)
            target.shutdown(socket.SHUT_RDWR)

    def hold(self, seconds: float) -> None:
        self.passes.clear()
        threading.Event().wait(seconds)  # the length of the stall is what is tested
        self.passes.set()

    def close(self) -> None:
        self.passes.set()
        for each in (self._server, *self._open):
            each.close()


@pytest.fixture
def network(shared_rtsp: RtspCamera) -> Iterator[Network]:
    found = Network(shared_rtsp.port)
    yield found
    found.close()


@pytest.mark.quiet
@pytest.mark.parametrize("path", ["/h264", "/mjpeg"])
def test_what_the_network_held_back_for_3_s_is_as_old_as_it_is_and_skipped(
    network: Network, rtsp_source: Opened, path: str
):
    source = rtsp_source(f"rtsp://127.0.0.1:{network.port}{path}")
    usual = sorted(age_s(source.read()) for _ in range(60))
    assert usual[30] < 0.2
    network.hold(3.0)
    given = [(picture, age_s(picture)) for picture in (source.read() for _ in range(60))]
    skipped = sum(picture.skipped for picture, _ in given)
    assert 60 < skipped <= 95  # 90 pictures in 3 s; key pictures come each half second
    assert max(age for _, age in given[-30:]) < 0.3
    stamps = [picture.stamp_ns for picture, _ in given]
    assert stamps == sorted(set(stamps))
    # Beside the gap of what was skipped, the pictures are as far apart as the camera took them.
    gaps = sorted((after - before) / 1e9 for before, after in itertools.pairwise(stamps))
    assert gaps[len(gaps) // 2] == pytest.approx(1 / 30, abs=0.01)


@pytest.mark.quiet
def test_without_a_limit_nothing_is_skipped_and_stamps_are_true(network: Network):
    options = UrlOptions(timeout_s=PATIENT_S, hwaccel="none", max_lag_s=lambda: 0.0)
    source = open_url(f"rtsp://127.0.0.1:{network.port}/h264", options)
    for _ in range(10):
        source.read()
    network.hold(1.5)
    given = [(picture, age_s(picture)) for picture in (source.read() for _ in range(60))]
    source.close()
    assert sum(picture.skipped for picture, _ in given) == 0
    assert max(age for _, age in given) > 1.0


@pytest.mark.quiet
def test_a_slow_decoder_shows_the_newest_key_picture(
    shared_rtsp: RtspCamera, rtsp_source: Opened, monkeypatch: pytest.MonkeyPatch
):
    decode = VideoDecoder.decode

    def slowly(decoder: VideoDecoder, packet: object) -> Iterator[object]:
        threading.Event().wait(0.1)  # 10 Hz, of 30
        yield from decode(decoder, packet)

    monkeypatch.setattr(VideoDecoder, "decode", slowly)
    source = rtsp_source(shared_rtsp.url("/h264"))
    given = [(picture, age_s(picture)) for picture in (source.read() for _ in range(60))]
    assert sum(picture.skipped for picture, _ in given) > 60
    # A key picture each half second: what is shown is at most that much older than the limit.
    assert max(age for _, age in given[10:]) < 0.5 + 0.5 + 0.3


def test_a_camera_that_starts_again_is_opened_again(rtsp_source: Opened):
    first = RtspCamera()
    source = rtsp_source(first.url("/h264"))
    source.read()
    first.end()
    _, lost, _ = read_until_lost(source)
    assert first.url("/h264") in lost
    again = RtspCamera(first.port)
    try:
        assert age_s(rtsp_source(again.url("/h264")).read()) < 1.0
    finally:
        again.end()


@pytest.mark.parametrize(
    ("path", "transport"), [("/h264", "auto"), ("/h264", "udp"), ("/udp", "udp"), ("/udp", "auto")]
)
def test_rtsp_goes_over_tcp_or_udp(shared_rtsp: RtspCamera, path: str, transport: str):
    options = UrlOptions(timeout_s=PATIENT_S, hwaccel="none", transport=transport)
    source = open_url(shared_rtsp.url(path), options)
    assert source.read() is not None
    source.close()


def test_a_transport_that_the_server_refuses_is_said(shared_rtsp: RtspCamera):
    options = UrlOptions(timeout_s=PATIENT_S, transport="tcp")
    with pytest.raises(SourceError, match="refuses this transport of RTSP; set rtsp_transport"):
        open_url(shared_rtsp.url("/udp"), options)


def test_a_password_of_the_settings_opens_an_rtsp_camera(shared_rtsp: RtspCamera):
    options = UrlOptions(PATIENT_S, username="viewer", password="secret", hwaccel="none")
    source = open_url(shared_rtsp.url("/locked"), options)
    assert source.read() is not None
    assert "secret" not in source.description
    source.close()


def test_an_rtsp_camera_that_dies_is_lost_at_once(own_rtsp: RtspCamera, rtsp_source: Opened):
    source = rtsp_source(own_rtsp.url("/h264"))
    source.read()
    own_rtsp.end()
    _, lost, waited_s = read_until_lost(source)
    assert waited_s < SLACK_S
    assert own_rtsp.url("/h264") in lost
    with pytest.raises(SourceError, match="nobody listens there"):
        rtsp_source(own_rtsp.url("/h264"))


@pytest.mark.parametrize("part", ["header", "redirect", "picture", "chunk_size", "page"])
def test_a_server_that_drips_is_given_up_in_the_time_allowed(camera: HttpCamera, part: str):
    started_s = time.monotonic()
    with pytest.raises(SourceError, match=r"no usable picture from the server for 1 s"):
        opened(camera.url(f"/dripped_{part}"), SHORT_S)
    assert time.monotonic() - started_s < SLACK_S


def test_a_picture_that_is_dripped_later_is_lost_in_the_time_allowed(camera: HttpCamera):
    source = open_url(camera.url("/first_whole"), UrlOptions(SHORT_S, rate_hz=lambda: 20.0))
    given, lost, wait_s = read_until_lost(source)
    assert len(given) == 1
    assert "no usable picture from the server for 1 s" in lost
    assert wait_s < SLACK_S


def test_the_time_to_open_does_not_end_a_stream(camera: HttpCamera):
    with contextlib.closing(opened(camera.url("/sized"), SHORT_S)) as source:
        end_s = time.monotonic() + 2 * SHORT_S
        while time.monotonic() < end_s:
            source.read()


@pytest.mark.parametrize(
    "challenge",
    ['Digest realm="c", nonce="n", algorithm=SHA-256, qop="auth"', 'Bearer realm="c"'],
    ids=["SHA-256", "bearer"],
)
def test_an_unknown_way_to_ask_for_a_password_is_said_in_words(camera: HttpCamera, challenge: str):
    camera.challenge = challenge
    with pytest.raises(SourceError, match=r"asks for the password in a way that is not supported"):
        opened(camera.url("/challenging", "viewer:word@"))


@pytest.mark.parametrize("url", ["http://a..b/", "http://127.0.0.1/ü", "http://127.0.0.1/a b"])
def test_a_url_that_http_does_not_allow_is_said_in_words(url: str):
    with pytest.raises(SourceError, match=r"this is no valid URL"):
        opened(url)
