"""What someone who mistyped a name probably meant."""

from __future__ import annotations

import pytest

from zenoh_vision.error_text import did_you_mean, similar_names, suggestion


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
