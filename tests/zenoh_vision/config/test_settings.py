"""Options: flag over environment over file over default."""

from __future__ import annotations

from typing import Annotated, ClassVar

import pytest
from pydantic import Field

from zenoh_vision.config.settings import Settings, Shared, load_settings
from zenoh_vision.errors import ConfigurationError
from zv.camera.settings import CameraSettings
from zv.edge.settings import EdgeSettings
from zv.tracker.settings import TrackerSettings


@pytest.mark.parametrize(
    ("file", "inline", "environment", "flag", "expected"),
    [
        (None, None, None, None, 80),
        (1, None, None, None, 1),
        (1, 2, None, None, 2),
        (1, 2, "3", None, 3),
        (1, 2, "3", "4", 4),
        (1, None, None, "4", 4),
        (None, None, "3", None, 3),
        (1, None, "", None, 1),
    ],
)
def test_the_nearer_source_wins(toml, monkeypatch, file, inline, environment, flag, expected: int):
    if environment is not None:
        monkeypatch.setenv("ZV_CAMERA_QUALITY", environment)
    settings = load_settings(
        CameraSettings,
        flags={"quality": flag, "rate": None},
        config=None if file is None else toml(f"quality = {file}"),
        inline=None if inline is None else {"quality": inline},
    )
    assert settings.quality == expected
    assert settings.rate is None  # a flag that was not given sets nothing


def test_sources_are_merged_option_by_option(toml, monkeypatch):
    monkeypatch.setenv("ZV_EDGE_HIGH", "90.5")
    settings = load_settings(
        EdgeSettings, flags={"l2": False}, config=toml("sigma = 2.0\nlow = 10")
    )
    assert (settings.sigma, settings.low, settings.high, settings.l2) == (2.0, 10.0, 90.5, False)
    assert settings.aperture == 3


def test_environment_variables_with_other_prefixes_are_ignored(monkeypatch):
    monkeypatch.setenv("ZV_EDGE_LOW", "1")
    monkeypatch.setenv("QUALITY", "1")
    monkeypatch.setenv("ZV_TEST_DATA", "/data")
    assert load_settings(CameraSettings) == CameraSettings()


def test_the_environment_spells_a_list_as_json(monkeypatch):
    class Lists(Settings):
        env_prefix: ClassVar[str] = "ZV_LISTS_"
        names: Annotated[tuple[str, ...], Field(description="names")] = ()

    monkeypatch.setenv("ZV_LISTS_NAMES", '["a", "b"]')
    assert load_settings(Lists).names == ("a", "b")
    monkeypatch.setenv("ZV_LISTS_NAMES", "a")
    with pytest.raises(ConfigurationError, match=r"ZV_LISTS_NAMES = 'a' is not.*allowed: a list"):
        load_settings(Lists)


@pytest.mark.parametrize(
    ("model", "name", "text", "value"),
    [
        (CameraSettings, "rate", "12.5", 12.5),
        (CameraSettings, "width", "640", 640),
        (CameraSettings, "loop", "true", True),
        (CameraSettings, "loop", "0", False),
        (CameraSettings, "source", "0", "0"),
        (CameraSettings, "encoding", "mono16", "mono16"),
        (EdgeSettings, "aperture", "7", 7),
        (TrackerSettings, "median", "0", 0),
    ],
    ids=lambda value: str(getattr(value, "__name__", value)),
)
def test_text_of_flags_and_environment_becomes_the_options_type(
    monkeypatch, model: type[Settings], name: str, text: str, value: object
):
    by_flag = getattr(load_settings(model, flags={name: text}), name)
    monkeypatch.setenv(f"{model.env_prefix}{name.upper()}", text)
    by_environment = getattr(load_settings(model), name)
    assert (by_flag, by_environment) == (value, value)
    assert type(by_flag) is type(by_environment) is type(value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("rate = 10", 10.0),
        ("rate = 12.5", 12.5),
        ("source = 0", "0"),
        ('source = "rtsp://walk"', "rtsp://walk"),
        ("loop = true", True),
        ('camera = "rear_2"', "rear_2"),
    ],
)
def test_toml_values_of_the_right_type(toml, text: str, value: object):
    found = getattr(load_settings(CameraSettings, config=toml(text)), text.split()[0])
    assert (found, type(found)) == (value, type(value))


@pytest.mark.parametrize("model", [CameraSettings, TrackerSettings, EdgeSettings])
def test_every_option_has_a_default_that_is_allowed_and_a_description(model: type[Settings]):
    defaults = model()
    assert model.model_validate(defaults.model_dump(), strict=True) == defaults
    for name, field in model.model_fields.items():
        assert field.description, name


def test_the_trackers_defaults_are_the_tutorials_numbers():
    found = TrackerSettings()
    assert (found.history, found.var_threshold, found.detect_shadows) == (700, 25, True)
    assert (found.closing, found.median, found.threshold) == (20, 5, 127)


class Radio(Settings):
    env_prefix: ClassVar[str] = "ZV_RADIO_"

    volume: Annotated[int, Field(ge=0, le=9, description="how loud"), Shared("ZV_VOLUME")] = 3


@pytest.mark.parametrize(
    ("variables", "volume"),
    [
        ({}, 3),
        ({"ZV_VOLUME": "5"}, 5),
        ({"ZV_VOLUME": ""}, 3),
        ({"ZV_VOLUME": "5", "ZV_RADIO_VOLUME": "7"}, 7),
    ],
)
def test_a_programs_own_variable_overrides_the_shared_one(monkeypatch, variables, volume):
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert load_settings(Radio).volume == volume
    assert load_settings(Radio, flags={"volume": 8}).volume == 8


def test_an_error_names_the_variable_that_is_wrong(monkeypatch):
    monkeypatch.setenv("ZV_VOLUME", "10")
    with pytest.raises(ConfigurationError, match="ZV_VOLUME"):
        load_settings(Radio)
    monkeypatch.setenv("ZV_RADIO_VOLUME", "11")
    with pytest.raises(ConfigurationError, match="ZV_RADIO_VOLUME"):
        load_settings(Radio)
