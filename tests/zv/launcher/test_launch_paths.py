"""Paths in a file are relative to that file, wherever it is read from, and must exist."""

from __future__ import annotations

from pathlib import Path

import pytest

from zenoh_vision.config.settings import load_settings
from zenoh_vision.errors import ConfigurationError
from zv.camera.settings import CameraSettings
from zv.launcher.launch_file import PlannedNode, read_launch_file


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with files, seen from another working directory."""
    folder = tmp_path / "site"
    (folder / "files").mkdir(parents=True)
    for name in ("clip.avi", "front.yaml", "mask.png", "files/other.avi"):
        (folder / name).touch()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    return folder


def settings_of(path: Path, text: str) -> list[object]:
    path.write_text(text)
    nodes = read_launch_file(path).nodes
    assert all(isinstance(node, PlannedNode) for node in nodes)
    return [node.settings for node in nodes if isinstance(node, PlannedNode)]


def test_all_paths_of_a_launch_file_are_relative_to_it(site: Path):
    camera, edge = settings_of(
        site / "up.toml",
        '[[node]]\nservice = "camera"\n'
        'settings = { source = "clip.avi", calibration = "front.yaml" }\n'
        '[[node]]\nservice = "edge"\nsettings = { mask = "mask.png" }\n',
    )
    assert Path(camera.source) == site / "clip.avi"
    assert Path(camera.calibration) == site / "front.yaml"
    assert Path(edge.mask) == site / "mask.png"


def test_paths_of_a_config_file_are_relative_to_that_file(site: Path):
    (site / "files" / "front.toml").write_text('source = "other.avi"\n')
    (camera,) = settings_of(
        site / "up.toml", '[[node]]\nservice = "camera"\nconfig = "files/front.toml"\n'
    )
    assert Path(camera.source) == site / "files" / "other.avi"
    by_flag = load_settings(CameraSettings, config=site / "files" / "front.toml")
    assert by_flag.source == camera.source


def test_the_connection_of_a_nodes_file_is_refused_and_what_replaces_it_is_named(site: Path):
    (site / "front.toml").write_text('[connection]\ncredentials = "camera_front"\n')
    with pytest.raises(ConfigurationError, match=r"front.toml: \[connection\] is not .* --secure"):
        settings_of(site / "up.toml", '[[node]]\nservice = "camera"\nconfig = "front.toml"\n')


def test_paths_of_flags_and_of_the_environment_stay_as_they_are(
    site: Path, monkeypatch: pytest.MonkeyPatch
):
    assert load_settings(CameraSettings, flags={"source": "clip.avi"}).source == "clip.avi"
    monkeypatch.setenv("ZV_CAMERA_SOURCE", "clip.avi")
    assert load_settings(CameraSettings).source == "clip.avi"


@pytest.mark.parametrize(
    "source",
    ["synthetic", "0", "/dev/video7", "rtsp://camera/stream", "command:cat clip.avi"],
)
def test_a_source_that_is_no_path_stays_as_it_is(site: Path, source: str):
    config = site / "front.toml"
    config.write_text(f'source = "{source}"\n')
    assert load_settings(CameraSettings, config=config).source == source


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            'service = "camera"\nsettings = { source = "clap.avi" }',
            r"node\[0\]: source: there is no file or folder .*site/clap.avi; "
            r"did you mean '.*site/clip.avi'\?",
        ),
        (
            'service = "camera"\nsettings = { source = "synthetik" }',
            r"source: .* did you mean 'synthetic'\?",
        ),
        ('service = "camera"\nsettings = { calibration = "no.yaml" }', "calibration: .*no.yaml"),
        ('service = "edge"\nsettings = { mask = "no.png" }', "mask: .*no.png"),
    ],
)
def test_a_file_that_is_missing_is_told_before_the_start(site: Path, text: str, said: str):
    path = site / "up.toml"
    path.write_text(f"[[node]]\n{text}\n")
    with pytest.raises(ConfigurationError, match=said):
        read_launch_file(path)


def test_a_toml_file_may_begin_with_a_byte_order_mark(site: Path):
    (camera,) = settings_of(site / "up.toml", '\ufeff[[node]]\nservice = "camera"\n')
    assert camera.source == "synthetic"


def test_a_path_that_a_service_makes_is_relative_to_the_file_and_need_not_exist(site: Path):
    (recorder,) = settings_of(
        site / "up.toml",
        '[[node]]\nservice = "recorder"\nsettings = { output = "recordings/run.mcap" }\n',
    )
    assert Path(recorder.output).resolve() == site / "recordings" / "run.mcap"  # type: ignore[attr-defined]
