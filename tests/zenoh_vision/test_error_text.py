"""A wrong value as an error shows it, with near names; the errors themselves."""

from __future__ import annotations

from typing import Any

import pytest

from zenoh_vision import errors
from zenoh_vision.error_text import (
    did_you_mean,
    joined,
    shortened,
    similar_names,
    suggestion,
    without_password,
)


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("kraken", "'kraken'"),
        ("a" * 80, repr("a" * 80)),
        ("a" * 81, repr("a" * 60) + "... (81 characters)"),
        (1.5, "1.5"),
        (None, "None"),
    ],
    ids=["short", "just short enough", "too long", "number", "nil"],
)
def test_a_value_is_shown_whole_unless_it_is_long(value, shown):
    assert shortened(value) == shown


def test_a_list_is_shown_in_a_line_however_long_and_deep_it_is():
    deep: list[Any] = []
    for _ in range(10_000):
        deep = [deep]
    assert len(shortened(deep)) < 100
    assert len(shortened(list(range(1000)))) < 100


def test_names_are_listed_up_to_a_number_and_the_rest_is_counted():
    assert joined([], 2) == ""
    assert joined(["a", "b"], 2) == "a, b"
    assert joined(["a", "b", "c", "d"], 2) == "a, b and 2 more"


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("rtsp://camera:554/a", "rtsp://camera:554/a"),
        ("http://[fe80::1]:8080/a?b=c", "http://[fe80::1]:8080/a?b=c"),
        ("rtsp://me:word@camera:554/a?b=c", "rtsp://***@camera:554/a?b=c"),
        ("rtsp://me:w/or@d@camera/a", "rtsp://***@camera/a"),
        ("rtsp://me:w[or]d@camera/a", "rtsp://***@camera/a"),
        ("rtsp://me:wo\nrd@camera/a", "rtsp://***@camera/a"),
        ("http://camera/v?user=me&pwd=word&w=640", "http://camera/v?user=me&pwd=***&w=640"),
        ("http://camera/v?Access_Token=wo#rd/x", "http://camera/v?Access_Token=***"),
        ("rtsp://camera/user=me_password=word_channel=1", "rtsp://camera/user=me_password=***"),
        ("rtsp://camera/v;pw=word", "rtsp://camera/v;pw=***"),
        ("rtsp://me:word", "rtsp://me:***"),
        ("rtsp://me:word/path", "rtsp://me:***"),
        ("/data/key=1/walk.avi", "/data/key=1/walk.avi"),
        ("me:word@camera/a", "***@camera/a"),
        ("me@camera/a", "me@camera/a"),
        ("command:play rtsp://me:word@camera/a", "command:play rtsp://***@camera/a"),
    ],
)
def test_passwords_are_masked_wherever_a_url_has_them(url: str, shown: str):
    assert without_password(url) == shown
    assert "word" not in shortened(url).replace("password=", "")
    assert "word" not in shortened(["play", url]).replace("password=", "")


@pytest.mark.parametrize(
    ("name", "known", "near"),
    [
        pytest.param("qualty", ["quality", "rate"], ["quality"], id="a letter is missing"),
        pytest.param("CENTROYD", ["Tracks", "Centroid"], ["Centroid"], id="in other capitals"),
        pytest.param("zzz", ["quality", "rate"], [], id="like none"),
        pytest.param("rate", [], [], id="nothing is known"),
    ],
)
def test_the_known_name_that_is_like_another_is_found(name, known, near):
    assert similar_names(name, known) == near


def test_names_that_differ_in_capitals_alone_are_both_found():
    assert similar_names("frnt", ["Front", "front", "rear"], limit=2) == ["Front", "front"]


def test_however_far_names_are_one_is_the_nearest():
    assert similar_names("vision", ["lab", "site"], similarity=0.0) == ["site"]


def test_the_question_has_its_surroundings_only_if_there_is_one():
    assert suggestion("qualty", ["quality"], before="; ", after=" ") == "; did you mean 'quality'? "
    assert suggestion("zzz", ["quality"], before="; ", after=" ") == ""
    assert did_you_mean(["a.avi", "b.avi"]) == "did you mean a.avi or b.avi?"


@pytest.mark.parametrize(
    ("name", "status"),
    [
        ("VisionError", 1),
        ("ConfigurationError", 2),
        ("SourceError", 3),
        ("SourceLost", 3),
        ("RouterUnreachable", 4),
        ("ToldToStop", 0),
    ],
)
def test_exit_status(name: str, status: int):
    error = getattr(errors, name)("why")
    assert isinstance(error, errors.VisionError)
    assert error.exit_status == status


def test_a_payload_error_says_under_which_name_it_is_counted():
    error = errors.PayloadError("corrupt", "the PNG is truncated")
    assert (error.reason, error.detail) == ("corrupt", "the PNG is truncated")
    assert str(error) == "corrupt: the PNG is truncated"
