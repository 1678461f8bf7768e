"""The account of a recording: what is a loss, what is none, and what proves it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from tests.zv.bag.records import START_NS, frame, header, message
from zv.bag.recorder.ledger import FAR, Ledger

KEY = frame(0).key


def account(ledger: Ledger, key: str = KEY) -> dict[str, Any]:
    return ledger.account(0, 1)["keys"][key]


def test_numbers_without_a_gap_miss_nothing_wherever_they_begin() -> None:
    ledger = Ledger()
    for seq in range(100, 110):
        ledger.take(frame(seq))
    found = account(ledger)
    assert found["taken"] == 10
    assert found["missed"] == {}
    assert found["epochs"] == [
        {"epoch": START_NS, "first": 100, "last": 109, "missing": 0, "gaps": []}
    ]


def test_a_gap_is_counted_and_named_and_a_late_frame_closes_it() -> None:
    ledger = Ledger()
    for seq in (0, 1, 5, 3, 6, 6):
        ledger.take(frame(seq))
    found = account(ledger)
    assert found["missed"] == {"not_received": 2}
    assert found["epochs"][0]["gaps"] == [[2, 2], [4, 4]]
    assert found["repeated"] == 1


def test_a_gap_between_two_accounts_belongs_to_the_second() -> None:
    ledger = Ledger()
    ledger.take(frame(0))
    assert account(ledger)["missed"] == {}
    ledger.take(frame(3))
    found = account(ledger)
    assert found["missed"] == {"not_received": 2}
    assert (found["epochs"][0]["first"], found["epochs"][0]["last"]) == (1, 3)
    assert ledger.account(0, 1)["keys"] == {}


def test_the_first_frames_of_a_source_that_is_opened_again_are_missed() -> None:
    ledger = Ledger()
    ledger.take(frame(7))
    ledger.take(replace(frame(2), attachment=header(2, epoch=START_NS + 5)))
    assert account(ledger)["missed"] == {"not_received": 2}


def test_what_could_not_be_kept_is_missed_once_under_its_own_reason() -> None:
    ledger = Ledger()
    ledger.take(frame(0))
    ledger.miss(frame(1), "recorder_behind")
    ledger.take(frame(2))
    ledger.lose([frame(2)], "disk: No space left on device")
    found = account(ledger)
    assert found["missed"] == {"recorder_behind": 1, "disk: No space left on device": 1}
    assert found["taken"] == 1
    assert found["bytes"] == len(frame(0).payload)
    assert ledger.totals == {"taken": 1, "missed": 2, "bytes": len(frame(0).payload)}


def test_events_and_foreign_keys_prove_nothing() -> None:
    ledger = Ledger()
    for seq in (0, 40):
        ledger.take(message(seq, "events", "vision.TrackEvent.v1"))
        ledger.take(replace(message(seq), key="robot/arm"))
        ledger.take(replace(frame(seq), attachment=None))
    keys = ledger.account(0, 1)["keys"]
    assert {key: (each["unnumbered"], each["missed"]) for key, each in keys.items()} == {
        "vision/front/events": (2, {}),
        "robot/arm": (2, {}),
        KEY: (2, {}),
    }


def test_a_number_far_ahead_is_somebody_s_error_and_not_a_million_losses() -> None:
    ledger = Ledger()
    ledger.take(frame(0))
    ledger.take(replace(frame(1), attachment=header(FAR + 2)))
    assert account(ledger)["missed"] == {}


def test_what_a_sender_dropped_meanwhile_is_in_the_account() -> None:
    ledger = Ledger()
    ledger.health("tracker_front", {"received": 5, "dropped.overwritten": 3})
    ledger.health("tracker_front", {"received": 9, "dropped.overwritten": 5, "dropped.stale": 1})
    assert ledger.account(0, 1)["senders"] == {
        "tracker_front": {"dropped.overwritten": 2, "dropped.stale": 1}
    }
    ledger.health("tracker_front", {"received": 1, "dropped.overwritten": 1})  # started again
    assert ledger.account(0, 1)["senders"] == {}


def test_an_account_is_bounded_whatever_arrives() -> None:
    ledger = Ledger()
    for number in range(10_050):
        ledger.take(replace(frame(0), key=f"a/{number}"))
    for epoch in range(100):
        ledger.take(replace(frame(0), attachment=header(0, epoch=epoch)))
    found = ledger.account(0, 1)
    assert len(found["keys"]) == 10_000
    assert found["left_out"] == 50 + 100


def test_a_resumed_ledger_sees_the_gap_after_the_last_account() -> None:
    ledger = Ledger()
    for seq in range(5):
        ledger.take(frame(seq))
    before = ledger.account(0, 1)
    after = Ledger()
    after.resume([before])
    after.take(frame(7))
    assert account(after)["missed"] == {"not_received": 2}
