"""Network cameras, real ones on the loopback interface: good, badly behaved, and gone."""

from __future__ import annotations

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
from zv.camera.sources.base import Picture
from zv.camera.sources.url import UrlSource

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


def grey(picture: Picture) -> float:
    """Return the mean grey level of a picture that came as a JPEG."""
    assert picture.pixels is None
    return float(decoded(picture.jpeg).mean())


def read_until_lost(source: UrlSource) -> tuple[list[Picture], str, float]:
    """Return the pictures, why there are no more, and how long the last wait was, seconds."""
    pictures: list[Picture] = []
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
    ["sized", "unsized", "padded", "tables_missing", "dashes", "quoted", "unannounced"],
)
def test_each_picture_comes_once_in_order_and_undecoded(camera: HttpCamera, manner: str):
    source = UrlSource(camera.url(f"/{manner}"), timeout_s=PATIENT_S)
    given = [source.read() for _ in range(12)]
    source.close()
    assert [grey(picture) for picture in given] == pytest.approx(
        [level(index) for index in range(12)], abs=2
    )
    assert {(picture.encoding, picture.width, picture.height) for picture in given} == {
        ("bgr8", 64, 48)
    }
    assert all(picture.due_s is None for picture in given)


def test_a_packet_passes_byte_for_byte(camera: HttpCamera):
    source = UrlSource(camera.url("/sized"), timeout_s=PATIENT_S)
    assert source.read().jpeg == http_camera.picture(0)
    source.close()


def test_a_camera_paces_itself_and_says_what_it_is(camera: HttpCamera):
    source = UrlSource(camera.url("/sized"), timeout_s=PATIENT_S)
    assert source.live
    assert source.rate_hz is None
    assert source.description == f"{camera.url('/sized')} (64x48, MJPEG)"
    source.close()


def test_a_single_picture_is_given_before_the_server_ends(camera: HttpCamera):
    given, lost, _ = read_until_lost(UrlSource(camera.url("/snapshot"), timeout_s=PATIENT_S))
    assert len(given) == 1
    assert "the server ended the stream" in lost


def test_pictures_that_are_cut_short_are_left_out(camera: HttpCamera):
    source = UrlSource(camera.url("/hiccuping"), timeout_s=PATIENT_S)
    given = [grey(source.read()) for _ in range(6)]
    source.close()
    assert given == pytest.approx([level(index) for index in (0, 1, 3, 4, 6, 7)], abs=2)


@pytest.mark.parametrize(
    ("manner", "reason"),
    [
        ("hanging_up", "the server ended the stream"),
        ("cut", "the server ended the stream"),
        ("lying", "no video, or a damaged one"),
    ],
)
def test_a_server_that_breaks_off_is_lost_after_its_last_good_picture(
    camera: HttpCamera, manner: str, reason: str
):
    given, lost, _ = read_until_lost(UrlSource(camera.url(f"/{manner}"), timeout_s=PATIENT_S))
    assert len(given) == PICTURES_BEFORE_TROUBLE
    assert reason in lost
    assert camera.url(f"/{manner}") in lost


@pytest.mark.parametrize("manner", ["stalling", "dripping", "damaged"])
def test_a_server_without_new_pictures_is_lost_in_the_time_allowed(camera: HttpCamera, manner: str):
    source = UrlSource(camera.url(f"/{manner}"), timeout_s=SHORT_S)
    given, lost, waited_s = read_until_lost(source)
    assert len(given) == PICTURES_BEFORE_TROUBLE
    assert f"no usable picture from the server for {SHORT_S:g} s" in lost
    assert SHORT_S <= waited_s < SHORT_S + SLACK_S


ENDLESS = """
import sys
from zenoh_vision.errors import SourceError
from zv.camera.sources.url import UrlSource
try:
    source = UrlSource(sys.argv[1], timeout_s=float(sys.argv[2]))
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
        ("endless_jpeg", 4, "no video, or a damaged one|no usable picture"),
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


def test_a_server_that_never_answers_cannot_be_opened_in_the_time_allowed(camera: HttpCamera):
    started_s = time.monotonic()
    with pytest.raises(SourceError, match="no usable picture from the server"):
        UrlSource(camera.url("/silent"), timeout_s=SHORT_S)
    assert time.monotonic() - started_s < SHORT_S + SLACK_S


@pytest.mark.parametrize("scheme", ["http", "rtsp"])
def test_a_port_that_accepts_and_then_says_nothing_ends_in_the_time_allowed(scheme: str):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        started_s = time.monotonic()
        with pytest.raises(SourceError, match="no usable picture from the server"):
            UrlSource(f"{scheme}://127.0.0.1:{listener.getsockname()[1]}/", timeout_s=SHORT_S)
        assert time.monotonic() - started_s < SHORT_S + SLACK_S


@pytest.mark.parametrize("scheme", ["http", "rtsp"])
def test_a_port_without_a_listener_is_an_error(scheme: str):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(SourceError, match="nobody listens there"):
        UrlSource(f"{scheme}://127.0.0.1:{port}/", timeout_s=PATIENT_S)


@pytest.mark.parametrize(
    ("manner", "reason"),
    [
        ("nothing_here", r"no such path \(404\)"),
        ("locked", r"\(401\)"),
        ("broken", r"failed \(5xx\)"),
        ("page", "no video"),
    ],
)
def test_a_refusal_is_said_in_words(camera: HttpCamera, manner: str, reason: str):
    with pytest.raises(SourceError, match=reason) as caught:
        UrlSource(camera.url(f"/{manner}"), timeout_s=PATIENT_S)
    assert not isinstance(caught.value, SourceLost)


def test_user_and_password_in_the_url_open_the_camera_and_are_not_shown(camera: HttpCamera):
    url = camera.url("/locked", f"{http_camera.USER}:{http_camera.PASSWORD}@")
    source = UrlSource(url, timeout_s=PATIENT_S)
    source.read()
    source.close()
    assert http_camera.PASSWORD not in source.description
    assert http_camera.USER not in source.description
    assert "***@127.0.0.1" in source.description


@pytest.mark.parametrize("path", ["/locked", "/nothing_here", "/page", "/silent", "/hanging_up"])
def test_no_error_shows_the_password(camera: HttpCamera, path: str):
    url = camera.url(f"{path}?token=hidden-token", "someone:hidden-word@")
    with pytest.raises(SourceError) as caught:
        read_until_lost_or_raise(UrlSource(url, timeout_s=SHORT_S))
    shown = f"{caught.value!r} {caught.value.__cause__!r} {caught.value.args}"
    assert "hidden" not in shown
    assert "someone" not in shown
    assert caught.value.__suppress_context__  # or a traceback would print libav's own error


def read_until_lost_or_raise(source: UrlSource) -> None:
    try:
        while source.read() is not None:
            pass
    finally:
        source.close()


@pytest.mark.quiet
def test_after_a_pause_the_pictures_in_between_come_faster_than_new_ones(camera: HttpCamera):
    camera.rate_hz = 20.0
    source = UrlSource(camera.url("/sized"), timeout_s=PATIENT_S)
    source.read()
    threading.Event().wait(1.0)  # the pause itself is what is tested: 20 pictures pile up
    started_s = time.monotonic()
    for _ in range(15):
        source.read()
    assert time.monotonic() - started_s < 0.2  # at their own rate these would take 0.75 s
    source.close()


def test_a_recording_behind_a_url_plays_at_its_own_pace_and_ends(
    camera: HttpCamera, tmp_path: Path
):
    camera.recording = make_video(tmp_path / "a.mkv", rate=10).read_bytes()
    source = UrlSource(camera.url("/recording"), timeout_s=PATIENT_S)
    assert not source.live
    given = list(iter(source.read, None))
    assert [picture.due_s for picture in given] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    source.close()


class RtspCamera:
    """The server of ``rtsp_camera.py`` in a process of its own."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [need(SYSTEM_PYTHON, "python3"), str(RTSP_SERVER)],
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
def rtsp_source() -> Iterator[Callable[..., UrlSource]]:
    opened: list[UrlSource] = []

    def open_it(url: str, timeout_s: float = PATIENT_S) -> UrlSource:
        opened.append(UrlSource(url, timeout_s=timeout_s))
        return opened[-1]

    yield open_it
    for source in opened:
        source.close()


Opened = Callable[..., UrlSource]


def test_h264_over_rtsp_is_decoded(shared_rtsp: RtspCamera, rtsp_source: Opened):
    source = rtsp_source(shared_rtsp.url("/h264"))
    assert source.live
    assert source.description == f"{shared_rtsp.url('/h264')} (320x240, H264)"
    given = [source.read() for _ in range(10)]
    assert {(picture.encoding, shown(picture).shape) for picture in given} == {
        ("bgr8", (240, 320, 3))
    }
    assert all((shown(one) != shown(other)).any() for one, other in itertools.pairwise(given)), (
        "the ball moves in each picture"
    )


def test_mjpeg_over_rtsp_comes_through_undecoded_with_its_tables(
    shared_rtsp: RtspCamera, rtsp_source: Opened
):
    picture = rtsp_source(shared_rtsp.url("/mjpeg")).read()
    assert picture.pixels is None
    assert b"\xff\xc4" in picture.jpeg
    assert decoded(picture.jpeg).shape == (240, 320, 3)


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
        UrlSource(shared_rtsp.url(path, credentials), timeout_s=PATIENT_S)
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


def test_an_rtsp_camera_that_dies_is_lost_at_once(own_rtsp: RtspCamera, rtsp_source: Opened):
    source = rtsp_source(own_rtsp.url("/h264"))
    source.read()
    own_rtsp.end()
    _, lost, waited_s = read_until_lost(source)
    assert waited_s < SLACK_S
    assert own_rtsp.url("/h264") in lost
    with pytest.raises(SourceError, match="nobody listens there"):
        rtsp_source(own_rtsp.url("/h264"))
