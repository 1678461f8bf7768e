"""What a parameter says of itself, and which changes are allowed."""

from __future__ import annotations

import re
from typing import Any

import pytest
from pydantic import ValidationError

from tests.support.library import LIVE, LampSettings
from zenoh_vision.config.parameters import changed, live_fields, parameter
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.messages import Parameter
from zv.registry import SERVICES, model_of

NODE_SERVICES = [name for name in SERVICES if name != "router"]


def said(name: str, **values: Any) -> dict[str, Any]:
    found = parameter("lamp_front", LampSettings(**values), name, 7).to_map()
    assert (found.pop("node"), found.pop("name"), found.pop("revision")) == ("lamp_front", name, 7)
    return found


def test_the_live_options_are_those_with_the_mark_in_the_models_order():
    assert tuple(live_fields(LampSettings)) == LIVE


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("power", ("int", 0, 100, None, "percent", "how bright")),
        ("blink", ("float", 0.5, 20, None, "Hz", "how often; it clicks")),
        ("on", ("bool", None, None, None, None, "whether it is lit")),
        ("colour", ("str", None, None, ("white", "red"), None, "of the light")),
        ("bulbs", ("int", None, None, ("1", "2", "4"), None, "how many")),
        ("seed", ("int", 0, 255, None, None, "of the flicker")),
        ("label", ("str", None, None, None, None, "on it")),
    ],
)
def test_a_parameter_says_type_range_choices_unit_and_meaning(name: str, expected: tuple):
    kinds = ("type", "minimum", "maximum", "choices", "unit", "description")
    found = said(name)
    assert tuple(found[kind] for kind in kinds) == expected


@pytest.mark.parametrize("service", ["camera", "edge"])
def test_the_form_of_a_region_is_in_its_meaning_and_in_its_refusal(service: str):
    form = "whole numbers X,Y,WIDTH,HEIGHT without blanks, WIDTH and HEIGHT at least 1, or empty"
    settings = model_of(service)()
    assert parameter("node", settings, "region", 0).description.endswith(f"; {form}")
    for text in ("0,0,0,0", "abc", "1, 2, 30, 40"):
        with pytest.raises(ParameterRefused) as caught:
            changed(settings, {"region": text})
        assert caught.value.allowed == f"{form}, at most 40 characters"


def test_a_parameter_says_its_value_and_its_default_with_their_types():
    found = said("power", power=3)
    assert (found["value"], found["default"]) == (3, 50)
    assert said("on", on=False)["value"] is False
    assert (said("blink")["value"], said("blink", blink=2)["value"]) == (None, 2.0)


@pytest.mark.parametrize("service", NODE_SERVICES)
def test_a_parameter_allows_its_default_its_bounds_and_its_choices_and_nothing_beyond(service: str):
    settings = model_of(service)()
    for name in live_fields(type(settings)):
        found: Parameter = parameter("node", settings, name, 0)
        assert found.description
        typed = {"int": int, "float": float, "str": str, "bool": bool}[found.type]
        values: list[Any] = [found.default, found.minimum, found.maximum, *(found.choices or ())]
        for value in (typed(each) for each in values if each is not None):
            if value == "detector":  # needs a model, which cannot be named over the network
                with pytest.raises(ParameterRefused, match="needs model"):
                    changed(settings, {name: value})
                continue
            # Edge's thresholds must be in order.
            both = {"low": value, "high": value} if name in ("low", "high") else {name: value}
            assert getattr(changed(settings, both), name) == value
        step = 1 if found.type == "int" else 1e-6
        for bound, sign in ((found.minimum, -1), (found.maximum, 1)):
            if bound is not None:
                with pytest.raises(ParameterRefused, match=f"^{name} = "):
                    changed(settings, {name: typed(bound) + sign * step})


def test_options_of_identity_files_access_and_memory_are_not_live():
    fixed = {
        service: set(model_of(service).model_fields) - set(live_fields(model_of(service)))
        for service in NODE_SERVICES
    }
    # No file is live: whoever may set parameters could read any file of the machine.
    # Nor is anything that says who may reach the viewer, or how much memory a frame may take,
    # and how much of the disk, or for how long, events.
    assert fixed == {
        # The controls of an open device are live, each under a name of its own.
        "camera": {
            *("camera", "source", "calibration", "max_pixels", "controls", "wait_for_source"),
            *("username", "password", "password_file", "rtsp_transport", "libav_options"),
            *("hwaccel", "video_stream", "lockstep", "wait_for"),
        },
        "tracker": {
            *("camera", "max_pixels", "model", "runtime", "device", "model_threads", "layout"),
            *("input_size", "fit", "colours", "values", "class_names"),
        },
        "edge": {"camera", "mask", "max_pixels"},
        "notify": {"camera", "mqtt", "prefix", "discovery", "webhook"},
        "relay": {"camera", "key", "to"},
        "viewer": {
            *("name", "host", "port", "address", "token", "allow_host", "max_pixels", "recording"),
            *("tls_certificate", "tls_key", "tls_clients", "tls_operators", "tls_guests"),
            *("events_dir", "keep_events", "events_mb", "recordings_dir", "start"),
        },
        "recorder": {
            *("output", "keys", "exclude", "split_mb", "split", "total_mb", "last", "after"),
            *("on_event", "on_level", "memory_mb"),
        },
    }


def test_several_values_change_at_once():
    before = LampSettings()
    after = changed(before, {"low": 5.0, "high": 6, "on": False, "blink": None})
    assert (after.low, after.high, after.on, after.power) == (5.0, 6.0, False, 50)
    assert type(after.high) is float
    assert before == LampSettings()


def test_an_option_that_is_not_live_may_come_along_if_it_stays_as_it_is():
    settings = LampSettings(camera="rear", socket="7")
    assert changed(settings, {"camera": "rear", "socket": "7", "power": 1}).power == 1


REFUSED = {
    "above the range": ({"power": 101}, "power = 101 is not allowed", "a whole number from 0 to"),
    "below the range": ({"low": -0.1}, "low = -0.1 is not allowed", "a number from 0 to 10"),
    "not a number": ({"low": float("nan")}, "low = nan", "a number from 0 to 10"),
    "infinity": ({"high": float("inf")}, "high = inf", "a number from 0 to 10"),
    "text for a number": ({"power": "50"}, "power = '50'", "a whole number"),
    "bytes for text": ({"label": b"x"}, "label = b'x'", "a text of at most 8 characters"),
    "a float for a whole number": ({"power": 50.0}, "power = 50.0", "a whole number"),
    "true for a number": ({"power": True}, "power = True", "a whole number"),
    "true for a choice of numbers": ({"bulbs": True}, "bulbs = True", "one of 1, 2, 4"),
    "a float for a choice": ({"bulbs": 2.0}, "bulbs = 2.0", "one of 1, 2, 4"),
    "one for true": ({"on": 1}, "on = 1", "true or false"),
    "no such choice": ({"colour": "blue"}, "colour = 'blue'", "one of white, red"),
    "a list": ({"power": (1, 2)}, "power = (1, 2)", "a whole number"),
    "a map": ({"label": {"a": 1}}, "label = {'a': 1}", "a text"),
    "nil": ({"power": None}, "power = None", "a whole number"),
    "too large for 64 bits": ({"power": 2**80}, "power = 120892581961", "a whole number"),
    "too long": ({"label": "x" * 9}, "label = 'xxxxxxxxx'", "at most 8 characters"),
    "far too long": ({"label": "x" * 60_000}, "label = 'xxxxxxxxx", "at most 8 characters"),
    "nearly nil": ({"blink": 0}, "blink = 0 ", "a number from 0.5 to 20, or nil: not set"),
    "together": ({"low": 9.0, "high": 3.0}, "low = 9 is above high", "low at most high"),
    "with what holds": ({"low": 9.0}, "low = 9 is above high", "low at most high"),
    "unknown": ({"bulb": 1}, "no parameter 'bulb'; did you mean 'bulbs'?", "power, blink, on"),
    "not text": ({b"power": 1}, "there is no parameter b'power'", "power, blink, on"),
    "a number as name": ({5: 1}, "there is no parameter 5", "power, blink, on"),
    "not live": ({"socket": "desk"}, "socket cannot change while the node runs", "power, blink"),
    "who it is": ({"camera": "rear"}, "camera cannot change while the node runs", "power"),
    "one of several": ({"power": 1, "high": 11}, "high = 11 is not allowed", "a number from 0"),
}


@pytest.mark.parametrize(("values", "error", "allowed"), REFUSED.values(), ids=REFUSED)
def test_what_is_wrong_is_refused_as_a_whole_with_what_would_be_right(
    values: dict[Any, Any], error: str, allowed: str
):
    settings = LampSettings()
    with pytest.raises(ParameterRefused) as caught:
        changed(settings, values)
    assert error in caught.value.error
    assert allowed in caught.value.allowed
    assert settings == LampSettings()
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


def test_each_of_several_wrong_values_is_named():
    with pytest.raises(ParameterRefused) as caught:
        changed(LampSettings(), {"power": 500, "colour": "blue", "on": True})
    assert re.findall(r"(\w+) = ", caught.value.error) == ["power", "colour"]
    assert "power: a whole number from 0 to 100; colour: one of white, red" in caught.value.allowed


def test_the_settings_stay_frozen():
    with pytest.raises(ValidationError):
        LampSettings().power = 5  # type: ignore[misc]
