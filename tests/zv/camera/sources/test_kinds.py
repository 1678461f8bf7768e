"""Which kind of source a setting means, and what is said when it means none."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.pictures.videos import jpeg_of, make_video, noise
from zenoh_vision.errors import SourceError
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import SourceOpener, expected_rate
from zv.camera.sources.base import Source
from zv.camera.sources.kinds import kind_of


@pytest.mark.parametrize(
    ("spec", "kind"),
    [
        ("synthetic", "synthetic"),
        ("0", "device"),
        ("12", "device"),
        ("/dev/video3", "device"),
        ("rtsp://camera/stream", "url"),
        ("RTSPS://camera/stream", "url"),
        ("http://camera/mjpeg", "url"),
        ("https://user:word@camera:8443/mjpeg?x=1", "url"),
    ],
)
def test_the_kind_is_told_from_the_setting(spec: str, kind: str):
    assert kind_of(spec) == kind


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("walk.avi", "video"),
        ("noext", "video"),
        ("one.PNG", "folder"),
        ("run.MCAP", "recording"),
        ("run.mcap.partial", "recording"),
    ],
)
def test_a_file_is_a_video_unless_its_name_says_otherwise(tmp_path: Path, name: str, kind: str):
    (tmp_path / name).write_bytes(b"x")
    assert kind_of(str(tmp_path / name)) == kind
    assert kind_of(str(tmp_path)) == "folder"


def test_a_missing_file_is_explained_with_what_a_source_can_be_and_near_names(tmp_path: Path):
    (tmp_path / "walk.avi").write_bytes(b"x")
    with pytest.raises(SourceError) as caught:
        kind_of(str(tmp_path / "wlak.avi"))
    said = str(caught.value)
    assert f"did you mean {tmp_path / 'walk.avi'}? a source is" in said
    for kind in ("synthetic", "/dev/video0", "video file", "folder of images", "rtsp://"):
        assert kind in said


def test_a_mistyped_word_is_recognized():
    with pytest.raises(SourceError, match="did you mean synthetic"):
        kind_of("synthetics")


def test_a_pipe_is_refused_instead_of_waited_for(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(SourceError, match="a FIFO is no source; name the program"):
        kind_of(str(tmp_path / "pipe"))
    with pytest.raises(SourceError, match="standard input is no source; name the program"):
        kind_of("-")


def test_what_begins_with_command_is_a_program_whatever_follows():
    assert kind_of("command:rpicam-vid -t 0 -o - rtsp://somewhere") == "command"


@contextmanager
def as_nobody() -> Iterator[None]:
    """Take root's right to look everywhere away for a moment; others do not have it."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_a_file_behind_a_closed_folder_is_explained(tmp_path: Path):
    closed = tmp_path / "closed"
    closed.mkdir()
    (closed / "walk.avi").write_bytes(b"x")
    closed.chmod(0)
    with as_nobody(), pytest.raises(SourceError) as caught:
        kind_of(str(closed / "walk.avi"))
    closed.chmod(0o700)
    assert str(caught.value) == f"{closed / 'walk.avi'}: permission denied on the way to it"
    assert caught.value.exit_status == 3


@pytest.mark.parametrize(
    ("spec", "said"),
    # Longer than any path may be: the kernel says so, whatever the file system thinks of a name.
    [("x" * 5000, "File name too long"), ("wa\0lk.avi", "no such file or folder")],
    ids=["too long", "null byte"],
)
def test_a_name_that_no_file_can_have_is_explained(spec: str, said: str):
    with pytest.raises(SourceError, match=said):
        kind_of(spec)


def test_another_scheme_is_refused_naming_the_allowed_ones_and_no_password():
    with pytest.raises(SourceError, match=r"rtsp://, rtsps://, http://, https://") as caught:
        kind_of("ftp://user:word@camera/x")
    assert "word" not in str(caught.value)
    with pytest.raises(SourceError, match="no such file or folder") as caught:
        kind_of("user:word@camera/x")
    assert "word" not in str(caught.value)


def opened(spec: str) -> Source:
    settings = CameraSettings(source=spec, stall_after=1.0)
    return SourceOpener()(settings, lambda: settings)


def test_each_kind_is_opened_by_one_function(tmp_path: Path):
    (tmp_path / "one.jpg").write_bytes(jpeg_of(noise(48, 64, 3)))
    assert opened(str(tmp_path)).description.startswith("folder")
    assert opened(str(tmp_path / "one.jpg")).description.startswith("image one.jpg")
    video = opened(str(make_video(tmp_path / "walk.avi")))
    assert video.description == "video file walk.avi (64x48, MPEG4, 10 Hz)"
    video.close()
    with pytest.raises(SourceError, match="/dev/video99"):
        opened("99")
    with pytest.raises(SourceError, match="nobody listens"):
        opened("rtsp://127.0.0.1:9/")  # the port of "discard", where nothing is
    assert opened("synthetic").description == "synthetic scene (640x480, 30 Hz, seed 1)"


@pytest.mark.parametrize(
    ("source", "rate", "expected"),
    [
        pytest.param("synthetic", None, 30.0, id="synthetic: its default"),
        pytest.param("synthetic", 12.0, 12.0, id="synthetic: as set"),
        pytest.param("0", None, None, id="a device: its own"),
        pytest.param("0", 15.0, 15.0, id="a device: as set"),
        pytest.param("rtsp://camera/1", None, None, id="a URL: its own"),
        pytest.param(".", None, 10.0, id="a folder: its default"),
    ],
)
def test_the_rate_that_a_camera_is_judged_by(
    source: str, rate: float | None, expected: float | None
):
    assert expected_rate(kind_of(source), CameraSettings(source=source, rate=rate)) == expected
