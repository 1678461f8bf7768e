"""Durations: one way to type them, wherever an option is one."""

from __future__ import annotations

import pytest

from zenoh_vision.cli.flags import ConnectionSettings, ToolConnectionSettings
from zenoh_vision.config.constraints import allowed, is_duration
from zenoh_vision.config.durations import duration_text, seconds_of
from zenoh_vision.config.parameters import changed, live_fields, parameter
from zenoh_vision.config.settings import Settings, load_settings
from zenoh_vision.errors import ConfigurationError, ParameterRefused
from zv.camera.settings import CameraSettings
from zv.registry import SERVICES, imported, model_of
from zv.tools.registry import TOOLS

MODELS: list[type[Settings]] = [
    ConnectionSettings,
    ToolConnectionSettings,
    *map(model_of, SERVICES),
    *(imported(tool.options) for tool in TOOLS.values()),
]
TIMES = ("timeout", "window", "for_", "wait", "max_age", "stall_after", "every", "gone")


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        *dict.fromkeys(("5", "5s", "5 s", " 5s "), 5.0).items(),
        *dict.fromkeys(("0.5", ".5s", "500ms"), 0.5).items(),
        *{"2m": 120.0, "2min": 120.0, "1.5h": 5400.0, "1d": 86_400.0}.items(),
    ],
)
def test_a_duration_is_typed_with_or_without_a_unit(text: str, seconds: float):
    assert seconds_of(text) == seconds


@pytest.mark.parametrize(
    "text",
    ["", "s", "5x", "1.2.3", "-1s", "5 s s", "nan", "inf", "1e3", "2M", "9" * 400, "110000d"],
)
def test_what_is_no_duration_is_refused(text: str):
    with pytest.raises(ValueError, match="not a duration"):
        seconds_of(text)


@pytest.mark.parametrize("model", MODELS)
def test_no_limit_in_megabytes_is_too_large_for_a_number_of_bytes(model: type[Settings]):
    for name, field in model.model_fields.items():
        if name.endswith("_mb"):
            assert any(getattr(each, "le", 1e99) <= 1e9 for each in field.metadata), name


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0s"), (0.001, "1ms"), (0.4, "400ms"), (1, "1s"), (90, "90s"), (86400, "24h")],
)
def test_a_duration_is_shown_in_its_largest_whole_unit(seconds: float, text: str):
    assert duration_text(seconds) == text
    assert seconds_of(text) == seconds


def test_flag_environment_file_and_parameter_take_the_same_texts(
    monkeypatch: pytest.MonkeyPatch, toml
):
    assert load_settings(CameraSettings, flags={"stall_after": "2m"}).stall_after == 120
    assert load_settings(CameraSettings, config=toml('stall_after = "500ms"')).stall_after == 0.5
    monkeypatch.setenv("ZV_CAMERA_STALL_AFTER", "7s")
    settings = load_settings(CameraSettings)
    assert settings.stall_after == 7
    changed_settings = changed(settings, {"stall_after": "1500ms"})
    assert changed_settings.stall_after == 1.5
    assert parameter("camera_front", changed_settings, "stall_after", 1).type == "float"


def test_an_error_about_a_duration_says_how_to_type_one(monkeypatch: pytest.MonkeyPatch):
    said = "a duration such as 5, 5s, 500ms, 2m, from 100ms to 1h"
    for text in ("5x", "2h"):
        with pytest.raises(ConfigurationError, match=said):
            load_settings(CameraSettings, flags={"stall_after": text})
        with pytest.raises(ParameterRefused, match=said):
            changed(CameraSettings(), {"stall_after": text})
    monkeypatch.setenv("ZV_TIMEOUT", "soon")
    with pytest.raises(ConfigurationError, match=r"ZV_TIMEOUT = 'soon' is not .*such as 5, 5s"):
        load_settings(ConnectionSettings)


def test_every_option_that_is_a_time_is_a_duration():
    for model in MODELS:
        live = live_fields(model)
        for name, field in model.model_fields.items():
            unit = live[name].unit if name in live else None
            named = name in TIMES and unit in (None, "s")
            is_time = named or unit == "s" or "seconds" in (field.description or "")
            if is_time:
                assert is_duration(model, name), (model, name)
            if is_duration(model, name):
                assert "such as 5, 5s, 500ms, 2m" in allowed(model, name)
