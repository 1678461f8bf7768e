"""Network cameras, real ones on the loopback interface: good, badly behaved, and gone."""

from __future__ import annotations

import contextlib
import socket
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.pictures import http_camera
from tests.support.pictures.http_camera import PICTURES_BEFORE_TROUBLE, HttpCamera, level
from tests.support.pictures.url_sources import SHORT_S, SLACK_S, Opened, read_until_lost
from tests.support.pictures.videos import decoded, make_video
from tests.support.processes import run_program
from zenoh_vision.errors import SourceError, SourceLost
from zv.camera.sources.base import KnowsNextDue, TimedPicture


@pytest.fixture(autouse=True)
def _no_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("http_proxy", raising=False)


@pytest.fixture
def camera() -> Iterator[HttpCamera]:
    with HttpCamera() as running:
        yield running


def grey(timed: TimedPicture) -> float:
    """Return the mean grey level of a picture that came as a JPEG."""
    return float(decoded(timed.picture.data).mean())


@pytest.mark.parametrize(
    "manner",
    [
        *("sized", "unsized", "padded", "tables_missing", "dashes", "quoted", "unannounced"),
        *("lying", "boundary_after", "octets"),
    ],
)
def test_each_picture_comes_once_in_order_and_undecoded(
    camera: HttpCamera, opened: Opened, manner: str
):
    source = opened(camera.url(f"/{manner}"), max_lag_s=lambda: 0.0)
    given = [source.read() for _ in range(12)]
    assert [grey(picture) for picture in given] == pytest.approx(
        [level(index) for index in range(12)], abs=2
    )
    assert {(each.picture.encoding, each.picture.size) for each in given} == {("bgr8", (64, 48))}
    assert all(picture.due_s is None for picture in given)


def test_a_packet_passes_byte_for_byte_and_the_camera_paces_itself(
    camera: HttpCamera, opened: Opened
):
    source = opened(camera.url("/sized"))
    assert source.read().picture.data == http_camera.picture(0)
    assert (source.live, source.rate_hz) == (True, None)
    assert source.description == f"{camera.url('/sized')} (64x48, MJPEG)"


def test_a_single_picture_is_asked_for_again_and_again(camera: HttpCamera, opened: Opened):
    source = opened(camera.url("/snapshot"), rate_hz=lambda: 20.0)
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


def test_pictures_that_are_cut_short_are_left_out(camera: HttpCamera, opened: Opened):
    source = opened(camera.url("/hiccuping"))
    given = [grey(source.read()) for _ in range(6)]
    assert given == pytest.approx([level(index) for index in (0, 1, 3, 4, 6, 7)], abs=2)


@pytest.mark.parametrize("manner", ["hanging_up", "cut"])
def test_a_server_that_breaks_off_is_lost_after_its_last_good_picture(
    camera: HttpCamera, opened: Opened, manner: str
):
    given, lost, _ = read_until_lost(opened(camera.url(f"/{manner}")))
    assert len(given) == PICTURES_BEFORE_TROUBLE
    assert "the server ended the stream" in lost
    assert camera.url(f"/{manner}") in lost


@pytest.mark.parametrize("manner", ["stalling", "dripping", "damaged"])
def test_a_server_without_new_pictures_is_lost_in_the_time_allowed(
    camera: HttpCamera, opened: Opened, manner: str
):
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
    source = open_url(sys.argv[1], UrlOptions(timeout_s=30))
    while True:
        source.read()
except SourceError as error:
    print(error)
# Not ru_maxrss, which a process inherits from the one that started it.
print(open("/proc/self/status").read().partition("VmHWM:")[2].split()[0])
"""


@pytest.mark.parametrize("manner", ["endless", "endless_jpeg"])
def test_a_picture_without_an_end_is_given_up_before_it_takes_the_memory(
    camera: HttpCamera, manner: str
):
    done = run_program([sys.executable, "-c", ENDLESS, camera.url(f"/{manner}")])
    said, peak_kb = done.stdout.splitlines()
    assert "far too large, or has no end" in said
    assert int(peak_kb) * 1024 < 400e6  # a block grows by copying: twice the limit, and the program


@pytest.mark.parametrize("scheme", ["http", "rtsp"])
def test_a_port_that_accepts_and_then_says_nothing_ends_in_the_time_allowed(
    opened: Opened, scheme: str
):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        started_s = time.monotonic()
        with pytest.raises(SourceError, match="no usable picture from the server"):
            opened(f"{scheme}://127.0.0.1:{listener.getsockname()[1]}/", SHORT_S)
        assert time.monotonic() - started_s < SHORT_S + SLACK_S


@pytest.mark.parametrize("scheme", ["http", "rtsp"])
def test_a_port_without_a_listener_is_an_error(opened: Opened, scheme: str):
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
def test_a_refusal_is_said_in_words(camera: HttpCamera, opened: Opened, manner: str, reason: str):
    with pytest.raises(SourceError, match=reason) as caught:
        opened(camera.url(f"/{manner}"))
    assert not isinstance(caught.value, SourceLost)


def test_user_and_password_in_the_url_open_the_camera_and_are_not_shown(
    camera: HttpCamera, opened: Opened
):
    url = camera.url("/locked", f"{http_camera.USER}:{http_camera.PASSWORD}@")
    source = opened(url)
    source.read()
    assert http_camera.PASSWORD not in source.description
    assert http_camera.USER not in source.description
    assert "***@127.0.0.1" in source.description


@pytest.mark.parametrize("path", ["/locked", "/nothing_here", "/page", "/silent", "/hanging_up"])
def test_no_error_shows_the_password(camera: HttpCamera, opened: Opened, path: str):
    url = camera.url(f"{path}?token=hidden-token", "someone:hidden-word@")
    with pytest.raises(SourceError) as caught:
        list(iter(opened(url, SHORT_S).read, None))
    shown = f"{caught.value!r} {caught.value.__cause__!r} {caught.value.args}"
    assert "hidden" not in shown
    assert "someone" not in shown
    # Or a traceback would print libav's own error.
    assert caught.value.__suppress_context__ or caught.value.__context__ is None


def test_after_a_pause_of_the_reader_the_newest_picture_comes_and_tells_its_age(
    camera: HttpCamera, opened: Opened
):
    camera.rate_hz = 50.0
    source = opened(camera.url("/sized"))
    first = source.read()
    threading.Event().wait(1.0)  # the pause itself is what is tested: 50 pictures pile up
    read_ns = time.time_ns()
    after = source.read()
    index = round((grey(after) - level(0)) / 10)
    passed = 1 + after.skipped
    assert passed > 10
    assert index == passed % 20
    assert (after.stamp_ns - first.stamp_ns) / 1e9 > 0.5
    assert (read_ns - after.stamp_ns) / 1e9 < 0.5


def test_after_a_pause_of_the_server_only_the_newest_of_what_comes_at_once_is_shown(
    camera: HttpCamera, opened: Opened
):
    source = opened(camera.url("/held_back"))
    given = [grey(source.read()) for _ in range(5)]
    after = source.read()
    assert given == pytest.approx([level(index) for index in range(5)], abs=2)
    assert (after.skipped, grey(after)) == (9, pytest.approx(level(14), abs=2))


@pytest.mark.parametrize("path", ["/locked", "/digest"])
def test_user_and_password_of_the_settings_are_sent_as_they_are(
    camera: HttpCamera, opened: Opened, path: str
):
    user = http_camera.USER
    source = opened(camera.url(path), username=user, password=http_camera.PASSWORD)
    source.read()
    assert source.description == f"{camera.url(path)} (64x48, MJPEG)"
    with pytest.raises(SourceError, match=r"\(401\)") as caught:
        opened(camera.url(path), username=user, password="hidden-word")
    assert "hidden" not in str(caught.value)


@pytest.mark.parametrize("mark", ["/", "?", "#"])
@pytest.mark.parametrize("scheme", ["http", "rtsp"])
def test_a_password_that_must_be_escaped_is_told_so(opened: Opened, scheme: str, mark: str):
    with pytest.raises(SourceError, match="must be written with %2F %3F or %23") as caught:
        opened(f"{scheme}://admin:hid{mark}den@127.0.0.1:1/stream")
    assert "hid" not in str(caught.value)


def test_a_scheme_in_capitals_is_the_same(camera: HttpCamera, opened: Opened):
    source = opened(camera.url("/sized").replace("http", "HTTP"))
    assert source.read() is not None


def test_a_proxy_is_named_if_the_camera_is_not_reached_through_it(
    opened: Opened, monkeypatch: pytest.MonkeyPatch
):
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
    camera: HttpCamera, opened: Opened, tmp_path: Path
):
    camera.recording = make_video(tmp_path / "a.mkv", rate=10).read_bytes()
    source = opened(camera.url("/recording"))
    assert not source.live
    given = list(iter(source.read, None))
    assert [picture.due_s for picture in given] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])


def test_a_live_stream_in_segments_is_paced_by_its_presentation_times(
    camera: HttpCamera, opened: Opened, tmp_path: Path
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
    assert [each.due_s for each in given] == pytest.approx([k / 25 for k in range(60)], abs=0.002)
    assert {each.stamp_ns for each in given} == {None}


def test_a_stream_over_tcp_is_played(opened: Opened, tmp_path: Path):
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


def test_a_protocol_that_libav_lacks_is_told_to_be_a_programs(opened: Opened):
    with pytest.raises(SourceError, match=r"without this protocol; .* command:PROGRAM ARGS"):
        opened("srt://127.0.0.1:9000")


@pytest.mark.parametrize("part", ["header", "redirect", "picture", "chunk_size", "page"])
def test_a_server_that_drips_is_given_up_in_the_time_allowed(
    camera: HttpCamera, opened: Opened, part: str
):
    started_s = time.monotonic()
    with pytest.raises(SourceError, match=r"no usable picture from the server for 1 s"):
        opened(camera.url(f"/dripped_{part}"), SHORT_S)
    assert time.monotonic() - started_s < SLACK_S


def test_a_picture_that_is_dripped_later_is_lost_in_the_time_allowed(
    camera: HttpCamera, opened: Opened
):
    source = opened(camera.url("/first_whole"), SHORT_S, rate_hz=lambda: 20.0)
    given, lost, wait_s = read_until_lost(source)
    assert len(given) == 1
    assert "no usable picture from the server for 1 s" in lost
    assert wait_s < SLACK_S


def test_the_time_to_open_does_not_end_a_stream(camera: HttpCamera, opened: Opened):
    source = opened(camera.url("/sized"), SHORT_S)
    end_s = time.monotonic() + 2 * SHORT_S
    while time.monotonic() < end_s:
        source.read()


@pytest.mark.parametrize(
    "challenge",
    ['Digest realm="c", nonce="n", algorithm=SHA-256, qop="auth"', 'Bearer realm="c"'],
    ids=["SHA-256", "bearer"],
)
def test_an_unknown_way_to_ask_for_a_password_is_said_in_words(
    camera: HttpCamera, opened: Opened, challenge: str
):
    camera.challenge = challenge
    with pytest.raises(SourceError, match=r"asks for the password in a way that is not supported"):
        opened(camera.url("/challenging", "viewer:word@"))


@pytest.mark.parametrize("url", ["http://a..b/", "http://127.0.0.1/ü", "http://127.0.0.1/a b"])
def test_a_url_that_http_does_not_allow_is_said_in_words(opened: Opened, url: str):
    with pytest.raises(SourceError, match=r"this is no valid URL"):
        opened(url)
