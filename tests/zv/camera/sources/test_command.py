"""Programs as sources: real ones, and what they do when they end, hang or are left alone."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from tests.support.pictures.http_camera import picture
from tests.support.pictures.videos import shown
from tests.support.processes import environment, need
from tests.support.viewer.pages import Page
from tests.support.waiting import DEADLINE_S, wait_until
from zenoh_vision.errors import SourceError, SourceLost
from zv.camera.sources.base import Source
from zv.camera.sources.command import open_command, words_of

PATIENT_S = 20.0
SIZE = "testsrc=size=64x48:rate=30"
FFMPEG = f"command:ffmpeg -v error -re -f lavfi -i {SIZE}"

Opened = Callable[..., Source]


@pytest.fixture
def opened() -> Iterator[Opened]:
    sources: list[Source] = []

    def open_it(spec: str, timeout_s: float = PATIENT_S) -> Source:
        sources.append(open_command(spec, timeout_s, lambda: 0.5))
        return sources[-1]

    yield open_it
    for source in sources:
        source.close()


def python(code: str) -> str:
    """Return the source that is a program in Python."""
    return f"command:{sys.executable} -c '{code}'"


@pytest.mark.parametrize(
    ("output", "summary"),
    [
        ("-c:v mjpeg -f mjpeg -", "64x48, MJPEG"),
        ("-c:v mjpeg -f mpjpeg -", "64x48, MJPEG"),
        ("-pix_fmt yuv420p -f yuv4mpegpipe -", "64x48, RAWVIDEO"),
        ("-pix_fmt gray -f yuv4mpegpipe -", "64x48, RAWVIDEO"),
        ("-c:v libx264 -tune zerolatency -g 15 -f h264 -", "64x48, H264"),
        ("-c:v libx264 -tune zerolatency -g 15 -f mpegts -", "64x48, H264"),
        ("-c:v libx265 -tune zerolatency -g 15 -f hevc -", "64x48, HEVC"),
    ],
    ids=["mjpeg", "multipart", "yuv4mpeg2", "grey", "h264", "mpegts", "h265"],
)
def test_what_ffmpeg_writes_is_shown_as_it_comes(opened: Opened, output: str, summary: str):
    need("ffmpeg", "ffmpeg")
    source = opened(f"{FFMPEG} {output}")
    assert source.description == f"command ffmpeg ({summary})"
    assert source.live
    given = [source.read() for _ in range(20)]
    assert {each.picture.size for each in given} == {(64, 48)}
    assert all((shown(given[0]) != shown(each)).any() for each in given[10:])
    assert 0 <= time.time_ns() - given[-1].stamp_ns < 2e9
    stamps = [each.stamp_ns for each in given]
    assert stamps == sorted(set(stamps))


SHOWN_IN_DOCS = [
    line.partition("| `")[2].partition("` |")[0]
    for line in Page("docs/cameras.md").text.splitlines()
    if "| `command:" in line
]
NEEDS_CAMERA = ("rpicam-vid", "cam", "aravissrc", "srt://", "v4l2src", "cat")


@pytest.mark.parametrize("spec", SHOWN_IN_DOCS)
def test_the_lines_of_the_docs_are_programs_that_show_pictures(opened: Opened, spec: str):
    words = shlex.split(spec.removeprefix("command:"))
    if any(word.startswith(NEEDS_CAMERA) for word in words):
        pytest.skip("it needs a camera that is not here")
    need(words[0], {"ffmpeg": "ffmpeg", "gst-launch-1.0": "gstreamer1.0-tools"}[words[0]])
    source = opened(spec)
    stamps = [source.read().stamp_ns for _ in range(5)]
    assert stamps == sorted(set(stamps))


def test_the_end_of_a_program_is_reported_with_what_it_said(opened: Opened, tmp_path: Path):
    (tmp_path / "a.jpg").write_bytes(picture(0))
    code = (
        'import sys; sys.stdout.buffer.write(open(sys.argv[1], "rb").read()); '
        'print("first\\nno camera at rtsp://someone:hidden@host", file=sys.stderr); sys.exit(7)'
    )
    source = opened(f"{python(code)} {tmp_path}/a.jpg")
    assert source.read() is not None
    with pytest.raises(SourceLost, match=r"it ended with status 7: first \| no camera") as lost:
        source.read()
    assert "hidden" not in str(lost.value)


@pytest.mark.parametrize(
    ("spec", "reason"),
    [
        ("command:", "names no program"),
        ("command:no-such-program -x", "there is no program 'no-such-program' on PATH"),
        ("command:cat 'x", "No closing quotation"),
        (python("raise SystemExit(3)"), "it ended with status 3"),
        (python('print(1000 * "just words ")'), "writes no video that libav knows"),
        (python("import os, signal; os.kill(os.getpid(), signal.SIGKILL)"), "by signal 9"),
    ],
)
def test_what_gives_no_pictures_is_refused_with_the_reason(opened: Opened, spec: str, reason: str):
    with pytest.raises(SourceError, match=reason):
        opened(spec)


def test_a_program_that_writes_nothing_is_given_up_in_time_and_ended(opened: Opened):
    marker = f"import time; time.sleep({3000 + os.getpid()})"
    with pytest.raises(SourceError, match=r"no output for 0\.3 s"):
        opened(python(marker), timeout_s=0.3)
    wait_until(lambda: not running(marker))


def test_a_program_that_stops_writing_is_lost_in_time(opened: Opened, tmp_path: Path):
    (tmp_path / "a.jpg").write_bytes(picture(0))
    source = opened(f"command:sh -c 'cat {tmp_path}/a.jpg; sleep 60'", timeout_s=0.5)
    source.read()
    with pytest.raises(SourceLost, match=r"no usable picture from sh for 0\.5 s"):
        source.read()


def running(text: str) -> list[psutil.Process]:
    """Return the processes that have a text on their command line, and are not ended."""
    found = []
    for process in psutil.process_iter():
        try:
            if text in process.cmdline() and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
        except psutil.Error:
            continue
    return found


def test_closing_ends_the_program_and_what_it_started(opened: Opened, tmp_path: Path):
    (tmp_path / "a.jpg").write_bytes(picture(0))
    seconds = str(4000 + os.getpid())
    source = opened(f"command:sh -c 'cat {tmp_path}/a.jpg; trap \"\" TERM; sleep {seconds} & wait'")
    source.read()
    wait_until(lambda: running(seconds))
    source.close()
    wait_until(lambda: not running(seconds))


HOLDER = """
import sys, time
from zv.camera.sources.command import open_command
source = open_command(sys.argv[1], 20, lambda: 0.5)
source.read()
print("reads", flush=True)
time.sleep(60)
"""


def test_a_program_ends_when_its_camera_is_killed(tmp_path: Path):
    (tmp_path / "a.jpg").write_bytes(picture(0))
    seconds = str(5000 + os.getpid())
    spec = f"command:sh -c 'cat {tmp_path}/a.jpg; sleep {seconds} & wait'"
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, spec], stdout=subprocess.PIPE, env=environment(), text=True
    )
    assert holder.stdout.readline() == "reads\n"
    wait_until(lambda: running(seconds))
    holder.send_signal(signal.SIGKILL)
    holder.communicate(timeout=DEADLINE_S)
    wait_until(lambda: not running(seconds))


def test_words_are_quoted_as_for_a_shell_and_no_shell_runs_them():
    words = words_of("command:echo 'a b' \"c|d\" $HOME *")
    assert words[1:] == ["a b", "c|d", "$HOME", "*"]


@pytest.mark.parametrize(
    "writes",
    ["printf abcdefgh; sleep", "while printf a; do sleep 0.05; done; sleep"],
    ids=["stops", "drips"],
)
def test_a_program_whose_begin_is_no_video_is_given_up_in_time_and_ended(
    opened: Opened, writes: str
):
    seconds = str(6000 + os.getpid())
    started_s = time.monotonic()
    with pytest.raises(SourceError, match=r"^command sh: no usable picture for 0\.5 s$"):
        opened(f"command:sh -c '{writes} {seconds}'", timeout_s=0.5)
    assert time.monotonic() - started_s < DEADLINE_S
    wait_until(lambda: not running(seconds))


def test_progress_that_writes_over_itself_is_not_kept_and_hides_no_error(opened: Opened):
    code = (
        'import sys; print("no camera", file=sys.stderr); '
        'sys.stderr.write("".join(f"frame={n}\\r" for n in range(250_000))); sys.exit(3)'
    )
    tracemalloc.start()
    try:
        with pytest.raises(SourceError, match=r"status 3: no camera \| frame=249999$"):
            opened(python(code))
        assert tracemalloc.get_traced_memory()[1] < 2_000_000  # 3.1 MB were written
    finally:
        tracemalloc.stop()


def test_a_program_whose_words_are_wrong_is_named_without_its_arguments():
    with pytest.raises(SourceError) as caught:
        words_of("command:vendor --pass 's3cret")
    assert str(caught.value) == "source: command vendor: No closing quotation"
