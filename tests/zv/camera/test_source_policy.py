"""The options that are tables, and what a change of settings asks of each kind of source."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from zenoh_vision.config.parameters import live_fields
from zenoh_vision.config.settings import load_settings
from zenoh_vision.errors import ConfigurationError, SourceError
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import (
    imposed_rate,
    needs_reopening,
    password_of,
    same_picture,
    scene_conditions,
)
from zv.camera.sources.kinds import Kind
from zv.camera.synthetic.faults import Fault
from zv.launcher.command_line import service_flags

KINDS: tuple[Kind, ...] = ("synthetic", "device", "video", "folder", "url", "command")
OTHER: dict[str, Any] = {
    "width": 320,
    "height": 240,
    "rate": 5.0,
    "fourcc": "MJPG",
    "loop": True,
    "encoding": "mono8",
    "quality": 5,
    "max_kbps": 800,
    "rotate": 90,
    "flip": "both",
    "region": "10,20,30,40",
    "stall_after": 1.0,
    "frozen_after": 1.0,
    "skip_repeats": True,
    "max_lag": 3.0,
    "reopen_min": 1.0,
    "reopen_max": 1.0,
    "seed": 9,
    "noise": 9.0,
    "objects": 1,
    "numbered": True,
    "faults": "drop@1+1",
}
REOPENING = {"synthetic": {"width", "height", "seed"}, "device": {"width", "height", "fourcc"}}
SHOWN = {"rate", "noise", "objects", "numbered", "faults"}


def test_every_parameter_has_another_value_here():
    assert set(OTHER) == set(live_fields(CameraSettings))
    assert all(getattr(CameraSettings(), name) != value for name, value in OTHER.items())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", OTHER)
def test_a_source_is_opened_again_only_for_what_it_cannot_change(kind: Kind, name: str):
    before, after = CameraSettings(), CameraSettings(**{name: OTHER[name]})
    expected = name in REOPENING.get(kind, set())
    assert needs_reopening(kind, before, after, source_hz=30.0) == expected


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", OTHER)
def test_a_picture_that_was_read_is_still_right_unless_it_was_made_of_what_changed(
    kind: Kind, name: str
):
    before, after = CameraSettings(), CameraSettings(**{name: OTHER[name]})
    made_of = REOPENING.get(kind, set()) | (SHOWN if kind == "synthetic" else set())
    assert same_picture(kind, before, after) == (name not in made_of)


@pytest.mark.parametrize(
    ("opened", "now", "source_hz", "expected"),
    [
        pytest.param(None, 10.0, 30.0, False, id="slower than the device: thinned out"),
        pytest.param(None, 30.0, 30.0, False, id="what the device has"),
        pytest.param(None, 60.0, 30.0, True, id="faster than the device is now"),
        pytest.param(60.0, 60.0, 30.0, False, id="faster, but it was asked for that"),
        pytest.param(60.0, 50.0, 30.0, True, id="faster, and it was not asked for just that"),
        pytest.param(10.0, 20.0, 10.0, True, id="faster than it was asked for"),
        pytest.param(20.0, 10.0, None, False, id="slower than it was asked for"),
        pytest.param(None, 10.0, None, True, id="a rate where none is known"),
        pytest.param(10.0, None, 10.0, True, id="its own again"),
    ],
)
def test_a_device_is_opened_again_for_a_rate_only_if_that_must_be_asked_of_it(
    opened: float | None, now: float | None, source_hz: float | None, expected: bool
):
    before, after = CameraSettings(rate=opened), CameraSettings(rate=now)
    assert needs_reopening("device", before, after, source_hz) == expected


def test_what_was_the_default_already_is_no_change_of_the_synthetic_scene():
    before, after = CameraSettings(), CameraSettings(width=640, height=480, rate=30.0)
    assert not needs_reopening("synthetic", before, after, 30.0)
    assert same_picture("synthetic", before, after)


@pytest.mark.parametrize(
    ("kind", "rate", "expected"),
    [
        ("synthetic", 5.0, None),  # its own time is at that rate
        ("folder", None, 10.0),
        ("folder", 5.0, 5.0),
        ("video", None, None),
        ("video", 5.0, 5.0),
    ],
)
def test_the_rate_that_the_reader_imposes(kind: Kind, rate: float | None, expected: float | None):
    assert imposed_rate(kind, CameraSettings(rate=rate)) == expected


def test_the_conditions_of_a_scene_are_those_of_the_settings():
    found = scene_conditions(
        CameraSettings(rate=7, noise=1, objects=2, numbered=True, faults="drop@1+2")
    )
    assert (found.rate_hz, found.noise, found.objects) == (7.0, 1.0, 2)
    assert found.numbered
    assert found.faults == (Fault("drop", 1, 2),)
    assert scene_conditions(CameraSettings()).rate_hz == 30.0


def test_a_password_comes_from_the_settings_or_the_first_line_of_a_file(tmp_path: Path):
    file = tmp_path / "password"
    file.write_text("p/a?s#s word\r\nsecond line\n")
    assert password_of(CameraSettings()) is None
    assert password_of(CameraSettings(password="x")) == "x"
    assert password_of(CameraSettings(password_file=str(file))) == "p/a?s#s word"
    with pytest.raises(ValidationError, match="only one of them"):
        CameraSettings(password="x", password_file=str(file))
    file.write_text("\n")
    with pytest.raises(SourceError, match="its first line is empty"):
        password_of(CameraSettings(password_file=str(file)))
    with pytest.raises(SourceError, match="No such file"):
        password_of(CameraSettings(password_file=str(tmp_path / "none")))


CONTROLS = {"gain": 40, "auto": True, "mode": "Manual Mode"}


def test_controls_are_a_table_in_a_file(tmp_path: Path):
    file = tmp_path / "camera.toml"
    file.write_text('[controls]\ngain = 40\nauto = true\nmode = "Manual Mode"\n')
    assert load_settings(CameraSettings, config=file).controls == CONTROLS


@pytest.mark.parametrize(
    "text",
    [
        "gain=40,auto=true,mode=Manual Mode",
        " gain = 40, auto = true , mode = Manual Mode ,",
        '{"gain": 40, "auto": true, "mode": "Manual Mode"}',
    ],
)
def test_controls_are_a_text_as_a_flag_and_in_the_environment(
    text: str, monkeypatch: pytest.MonkeyPatch
):
    assert load_settings(CameraSettings, flags={"controls": text}).controls == CONTROLS
    monkeypatch.setenv("ZV_CAMERA_CONTROLS", text)
    assert load_settings(CameraSettings).controls == CONTROLS


@pytest.mark.parametrize("text", ["gain", "=5", "{", '{"gain": [1]}', '{"gain": null}'])
def test_another_text_is_refused_with_the_form(text: str):
    with pytest.raises(ConfigurationError, match=r"--controls = .*NAME=VALUE,NAME=VALUE"):
        load_settings(CameraSettings, flags={"controls": text})


def test_zv_up_passes_them_on_whatever_characters_they_have():
    given = CameraSettings(controls={"mode": 'a, "b" = c', "gain": 1})
    flags, _ = service_flags("camera", given)
    text = flags[flags.index("--controls") + 1]
    assert load_settings(CameraSettings, flags={"controls": text}) == given
