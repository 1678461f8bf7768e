"""Wrong options: the error says where, what, and what is allowed instead."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from zenoh_vision.config.settings import Settings, load_settings
from zenoh_vision.errors import ConfigurationError, SourceError
from zv.camera.settings import CameraSettings
from zv.edge.settings import EdgeSettings
from zv.recorder.settings import RecorderSettings
from zv.tracker.settings import TrackerSettings


def refusal(model: type[Settings], **sources: Any) -> str:
    with pytest.raises(ConfigurationError) as caught:
        load_settings(model, **sources)
    assert caught.value.exit_status == 2
    return str(caught.value)


@pytest.mark.parametrize(
    ("model", "text", "words"),
    [
        (CameraSettings, 'rate = "10"', ["rate = '10'", "a number from 0.0001 to 1000"]),
        (CameraSettings, "quality = 80.0", ["quality = 80.0", "a whole number from 1 to 100"]),
        (CameraSettings, 'quality = "80"', ["quality = '80'", "default 80"]),
        (CameraSettings, "quality = true", ["quality = True"]),
        (CameraSettings, "loop = 1", ["loop = 1", "true or false"]),
        (CameraSettings, 'loop = "yes"', ["loop = 'yes'", "true or false"]),
        (CameraSettings, "source = 1.5", ["source = 1.5", "a text"]),
        (CameraSettings, "source = true", ["source = True", "a text"]),
        (CameraSettings, "rate = nan", ["rate = nan"]),
        (CameraSettings, "rate = inf", ["rate = inf"]),
        (CameraSettings, "rate = []", ["rate = []"]),
        (CameraSettings, "quality = 0", ["quality = 0", "from 1 to 100"]),
        (CameraSettings, "quality = 101", ["quality = 101", "from 1 to 100"]),
        (CameraSettings, "rate = 0", ["rate = 0", "from 0.0001"]),
        (CameraSettings, "width = 8", ["width = 8", "from 16 to 7680"]),
        (CameraSettings, 'encoding = "yuv"', ["encoding = 'yuv'", "mono8, mono16, bgr8, rgb8"]),
        (CameraSettings, 'camera = "Front"', ["camera = 'Front'", "letters a-z, digits and _"]),
        (CameraSettings, 'stall_after = "5 parsecs"', ["'5 parsecs'", "5s, 500ms, 2m, from 100ms"]),
        (CameraSettings, "stall_after = 7200", ["stall_after = 7200", "from 100ms to 1h"]),
        (EdgeSettings, "aperture = 4", ["aperture = 4", "one of 3, 5, 7"]),
        (EdgeSettings, 'aperture = "5"', ["aperture = '5'", "one of 3, 5, 7"]),
        (TrackerSettings, 'median = "5"', ["median = '5'", "one of 0, 3, 5, 7"]),
        (TrackerSettings, 'pipeline = "other"', ["pipeline = 'other'", "tutorial"]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_wrong_value_in_a_file_names_file_key_value_and_what_is_allowed(
    toml, model: type[Settings], text: str, words: list[str]
):
    path = toml(text)
    message = refusal(model, config=path)
    assert message.startswith(f"{path}: ")
    assert "; allowed: " in message
    assert all(word in message for word in words)


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("quality", "101", " (above 100)"),
        ("quality", "0", " (below 1)"),
        ("quality", "high", " (not a whole number)"),
        ("rate", "fast", " (not a number)"),
        ("rate", "0", " (below 0.0001)"),
        ("rate", "nan", " (Input should be a finite number)"),
        ("rate", "-1", " (below 0.0001)"),
        ("loop", "perhaps", " (Input should be a valid boolean, unable to interpret input)"),
        ("camera", "Front", ""),
        ("source", "", " (empty)"),
        ("calibration", "", " (empty)"),
    ],
)
def test_a_wrong_flag_or_variable_is_named_as_the_user_spelled_it_and_why_it_is_wrong(
    monkeypatch, name: str, text: str, why: str
):
    said = f" = {text!r} is not allowed{why}; allowed: "
    assert refusal(CameraSettings, flags={name: text}).startswith(f"command line: --{name}{said}")
    if text:  # an empty variable is ignored
        monkeypatch.setenv(f"ZV_CAMERA_{name.upper()}", text)
        place = f"environment: ZV_CAMERA_{name.upper()}"
        assert refusal(CameraSettings).startswith(f"{place}{said}")


@pytest.mark.parametrize(
    ("faults", "why"),
    [
        ("stall@1+1," * 660, "String should have at most 1000 characters"),
        ("x" * 900, f"fault {'x' * 60!r}... (900 characters): expected KIND@FRAME+FRAMES"),
    ],
    ids=["too long", "of another form"],
)
def test_of_a_long_value_the_beginning_and_the_length_are_shown(faults: str, why: str):
    message = refusal(CameraSettings, flags={"faults": faults})
    begun = f"command line: --faults = {faults[:60]!r}... ({len(faults)} characters) is not allowed"
    assert message.startswith(f"{begun} ({why}")
    assert len(message) < 500


def test_a_flag_of_two_words_is_named_with_a_hyphen():
    assert "--reopen-max = 'x'" in refusal(CameraSettings, flags={"reopen_max": "x"})


def test_a_wrong_value_is_refused_even_where_a_nearer_source_overrides_it(toml):
    message = refusal(CameraSettings, config=toml("quality = 0"), flags={"quality": "80"})
    assert "quality = 0" in message


def test_an_unknown_key_is_an_error_that_knows_the_nearest(toml, monkeypatch):
    path, inline = toml("qualiti = 80"), {"qualiti": 80}
    messages = {
        f"{path}: unknown key 'qualiti'": refusal(CameraSettings, config=path),
        "up.toml, node 2: unknown key 'qualiti'": refusal(
            CameraSettings, inline=inline, inline_place="up.toml, node 2"
        ),
        "command line: unknown key 'qualiti'": refusal(CameraSettings, flags={"qualiti": "80"}),
    }
    monkeypatch.setenv("ZV_CAMERA_QUALITI", "80")
    messages["environment: unknown key 'ZV_CAMERA_QUALITI'"] = refusal(CameraSettings)
    for begun, message in messages.items():
        assert message.startswith(begun)
        assert "did you mean 'quality'? allowed: camera, source, username" in message


def test_an_unknown_key_that_is_near_to_nothing_is_told_what_is_allowed(toml):
    message = refusal(CameraSettings, config=toml("zzz = 1"))
    assert "unknown key 'zzz'; allowed: camera, source" in message
    assert "did you mean" not in message


def test_an_unknown_variable_that_is_empty_is_ignored(monkeypatch):
    monkeypatch.setenv("ZV_CAMERA_QUALITI", "")
    assert load_settings(CameraSettings) == CameraSettings()


def test_a_table_in_a_file_is_an_unknown_key(toml):
    assert "unknown key 'tracker'" in refusal(TrackerSettings, config=toml("[tracker]\nmedian = 5"))


def test_a_rule_about_two_options_holds_across_sources(toml, monkeypatch):
    path = toml("low = 150")  # alone fine in a file whose high comes from elsewhere
    assert load_settings(EdgeSettings, config=path, flags={"high": "200"}).low == 150
    message = refusal(EdgeSettings, config=path)
    assert message.startswith(f"{path}: low = 150 is above high = 100")
    monkeypatch.setenv("ZV_EDGE_HIGH", "120")
    message = refusal(EdgeSettings, config=path)
    assert message.startswith(f"{path} and environment: low = 150 is above high = 120")
    message = refusal(EdgeSettings, flags={"low": "130"})
    assert message.startswith("environment and command line: low = 130 is above high = 120")
    assert message.endswith("allowed: low at most high")


def test_thresholds_may_be_equal():
    assert load_settings(EdgeSettings, flags={"low": "100"}).low == 100


@pytest.mark.parametrize("content", [b"quality = ", b"a = 1\na = 2", b"a = '\xff'"])
def test_a_file_that_is_no_toml_is_named(tmp_path: Path, content: bytes):
    path = tmp_path / "node.toml"
    path.write_bytes(content)
    assert refusal(CameraSettings, config=path).startswith(f"{path}: not TOML")


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path):
    missing = tmp_path / "missing.toml"
    for path, reason in ((missing, "No such file or directory"), (tmp_path, "Is a directory")):
        with pytest.raises(SourceError) as caught:
            load_settings(CameraSettings, config=path)
        assert (str(caught.value), caught.value.exit_status) == (f"{path}: {reason}", 3)


def test_of_choices_the_empty_one_is_written_with_quotes():
    assert "allowed: one of '', warn, error, stale" in refusal(
        RecorderSettings, flags={"on_level": "bad"}
    )
