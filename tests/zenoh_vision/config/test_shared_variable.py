"""One environment variable sets an option that several programs share."""

from __future__ import annotations

from typing import Annotated, ClassVar

import pytest
from pydantic import Field

from zenoh_vision.config.settings import Settings, Shared, load_settings
from zenoh_vision.errors import ConfigurationError


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
