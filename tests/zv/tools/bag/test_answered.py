"""The answers to each frame, found in the order of arrival."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import pytest

from tests.support.recordings import centroids, frames
from zv.bag.record import Record
from zv.tools.bag import answered
from zv.tools.bag.answered import AnsweredFrame, answered_frames

S = 10**9


def found(records: Iterable[Record]) -> list[AnsweredFrame]:
    ordered = sorted(records, key=lambda each: each.log_time_ns)
    return list(
        answered_frames(
            ordered,
            lambda each: each.key.endswith("image/compressed"),
            lambda each: each.header.get("node") == "tracker_front",
        )
    )


def test_each_frame_gets_its_own_answers_in_order():
    of = frames(300)  # 10 s
    results = found([*of, *centroids(of[::2])])
    assert [each.frame for each in results] == of
    assert [len(each.answers) for each in results] == [1, 0] * 150


def test_a_frame_in_two_forms_is_one_frame():
    of = frames(3)
    raw = [replace(each, encoding="image/png") for each in of]
    assert len(found([*of, *raw])) == 3


def test_what_came_before_a_frame_stays_before_it():
    of = frames(2)
    info = Record("vision/front/camera_info", b"", log_time_ns=of[0].log_time_ns + 1)
    assert [each.others for each in found([*of, info])] == [[], [info]]


def test_what_a_node_said_of_the_silence_after_a_frame_is_no_answer():
    of = frames(1)
    (answer,) = centroids(of)
    later = Record(answer.key, b"", "", answer.attachment, log_time_ns=answer.log_time_ns + 3 * S)
    assert found([*of, answer, later])[0].answers == [answer]


def test_an_answer_to_no_recorded_frame_is_left_out():
    of = frames(4)
    assert [len(each.answers) for each in found([*of[2:], *centroids(of)])] == [1, 1]


def test_an_answer_that_overtook_its_frame_is_one_and_later_ones_follow_it():
    of = frames(2)
    early, late = centroids([of[1]]) + centroids([of[1]])
    early = replace(early, log_time_ns=of[1].log_time_ns - 1)
    results = found([*of, early, late])
    assert [each.answers for each in results] == [[], [early, late]]


def test_what_other_nodes_said_of_a_frame_belongs_to_it_and_not_to_the_next():
    of = frames(2)
    other = Record("vision/front/tracks", b"", "", of[0].attachment, log_time_ns=of[0].log_time_ns)
    results = found([*of, other])
    assert [(each.others, each.results) for each in results] == [([], [other]), ([], [])]


def test_a_calibration_holds_from_when_it_came_whatever_frame_it_names():
    of = frames(3)
    at_ns = of[1].log_time_ns + 1
    info = Record("vision/front/camera_info", b"", "", of[0].attachment, log_time_ns=at_ns)
    assert [each.others for each in found([*of, info])] == [[], [], [info]]


def test_pictures_that_others_made_of_a_frame_count_among_what_waits(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(answered, "MOST_WAITING_BYTES", 100_000)
    (frame,) = of = frames(1)
    (answer,) = centroids(of)
    at_ns = frame.log_time_ns
    drawn = Record(
        "vision/front/tracked/compressed", bytes(100_000), "", frame.attachment, log_time_ns=at_ns
    )
    assert [each.answers for each in found([frame, answer])] == [[answer]]
    assert [each.answers for each in found([frame, drawn, answer])] == [[]], "given out before it"
