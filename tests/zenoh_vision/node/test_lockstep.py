"""What ends a wait for the answers of nodes."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from zenoh_vision import Header
from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.node.lockstep import Follower, Lockstep
from zenoh_vision.transport.query import Replies

FRAME = Header(camera="front", epoch=1, seq=3, stamp_ns=1, width=4, height=4)


@pytest.mark.parametrize(
    ("connected", "timed_out", "error"),
    [
        (True, False, "tracker_front ended before it answered frame 3 of front"),
        (False, False, "the router was lost before tracker_front answered frame 3 of front"),
        (True, True, "tracker_front has not answered frame 3 of front within 0.2 s"),
    ],
    ids=["not listed", "no router", "no list"],
)
def test_a_node_has_ended_if_a_complete_list_of_nodes_is_without_it(
    connected: bool, timed_out: bool, error: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    replies = Replies()
    replies.timed_out = timed_out
    monkeypatch.setattr("zenoh_vision.node.lockstep.ask", lambda *_: [replies])
    monkeypatch.setattr("zenoh_vision.node.lockstep.LOOK_S", 0.0)
    link = SimpleNamespace(session=None, connected=connected)
    lockstep = Lockstep(link, "vision", ["tracker_front"], answer_s=0.2)  # type: ignore[arg-type]
    lockstep._followers["tracker_front"] = Follower("tracker_front", frozenset({"front"}))
    with pytest.raises(ExpectationNotMet) as caught:
        lockstep.wait(FRAME)
    assert str(caught.value) == error


def test_it_is_said_once_for_which_node_one_waits(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    looks = 0

    def stopping() -> bool:
        nonlocal looks
        looks += 1
        return looks > 4

    monkeypatch.setattr("zenoh_vision.node.lockstep.ask", lambda *_: [Replies()])
    monkeypatch.setattr("zenoh_vision.node.lockstep.TELL_S", 0.0)
    link = SimpleNamespace(session=None)
    lockstep = Lockstep(link, "vision", ["tracker_front"], stopping)  # type: ignore[arg-type]
    lockstep.find({"front"}, None)
    assert caplog.messages == ["waiting: tracker_front does not run; nodes that run: none"]


def test_a_frame_that_is_sent_again_is_waited_for_again() -> None:
    link = SimpleNamespace(session=None)
    lockstep = Lockstep(link, "vision", [], lambda: True)  # type: ignore[arg-type]
    follower = lockstep._followers["a"] = Follower("a", frozenset({"front"}))
    follower.note(("front", 1, 3))
    assert lockstep.wait(FRAME)
    assert not lockstep.wait(FRAME)  # told to stop


@pytest.mark.parametrize(
    ("key", "taken"),
    [
        ("vision/front/image/compressed", True),
        ("vision/front/image", False),  # a form that nobody took is not waited for
        ("vision/left/image", True),
        ("vision/left/image/compressed", False),
    ],
)
def test_a_key_is_taken_that_one_of_the_nodes_subscribed_to(key: str, taken: bool) -> None:
    lockstep = Lockstep(SimpleNamespace(session=None), "vision", [])  # type: ignore[arg-type]
    for node, expression in (("a", "vision/front/image/compressed"), ("b", "vision/left/image")):
        said = ("no//expression", expression)  # a node may say anything
        lockstep._followers[node] = Follower(node, frozenset({"front"}), said)
    assert lockstep.takes(key) == taken
