"""Who is up, who is gone and for how long that is said. Times are arguments."""

from __future__ import annotations

import pytest

from common.errors import PayloadError
from common.messages import Diagnostics, Latency, NodeDescription
from services.tools.metrics.board import MAX_COUNTERS, MAX_NODES, SILENT_S, Board

GONE_S = 300.0


def health(node: str, **fields: object) -> Diagnostics:
    return Diagnostics.model_validate(
        {
            "node": node,
            "stamp_ns": 1,
            "level": 0,
            "message": "ok",
            "uptime_s": 1.0,
            "counters": {},
            "rate_hz": 0.0,
            "latency_ms": Latency(p50=None, p99=None),
            **fields,
        }
    )


def description(node: str) -> NodeDescription:
    return NodeDescription(
        node=node,
        service="tracker",
        cameras=("front",),
        version="1",
        host="here",
        pid=1,
        started_ns=1,
        publishes=(),
        subscribes=(),
    )


@pytest.fixture
def board() -> Board:
    return Board(GONE_S)


def up(board: Board, at_s: float) -> dict[str, bool]:
    return {known.node: known.up for known in board.nodes(at_s)}


def test_a_node_with_a_token_is_up_however_long_it_says_nothing(board: Board):
    board.came("a", 0.0)
    assert up(board, 10_000.0) == {"a": True}


def test_a_node_that_went_is_down_for_a_while_and_then_forgotten(board: Board):
    board.came("a", 0.0)
    board.went("a", 10.0)
    assert up(board, 10.0) == {"a": False}
    assert up(board, 10.0 + GONE_S) == {"a": False}
    assert up(board, 10.1 + GONE_S) == {}


def test_what_a_node_said_ends_with_it(board: Board):
    board.came("a", 0.0)
    board.report("a", health("a"), 1.0)
    board.describe("a", description("a"))
    (known,) = board.nodes(1.0)
    assert known.health is not None
    assert known.description is not None
    board.went("a", 2.0)
    (known,) = board.nodes(2.0)
    assert (known.health, known.description) == (None, None)


def test_a_node_that_comes_back_begins_anew(board: Board):
    board.came("a", 0.0)
    board.report("a", health("a"), 1.0)
    board.went("a", 2.0)
    board.came("a", 3.0)
    (known,) = board.nodes(3.0)
    assert (known.up, known.health) == (True, None)


def test_last_words_that_come_after_the_end_of_a_token_do_not_revive_a_node(board: Board):
    board.came("a", 0.0)
    board.went("a", 2.0)
    board.report("a", health("a"), 2.001)
    (known,) = board.nodes(2.001)
    assert (known.up, known.health) == (False, None)


def test_a_token_that_comes_after_the_first_words_keeps_them(board: Board):
    board.report("a", health("a", level=1), 0.0)
    board.came("a", 0.1)
    (known,) = board.nodes(1000.0)
    assert known.up
    assert known.health is not None


def test_a_node_without_a_token_is_up_while_it_reports(board: Board):
    board.report("a", health("a"), 0.0)
    assert up(board, SILENT_S) == {"a": True}
    assert up(board, SILENT_S + 0.1) == {"a": False}
    assert up(board, SILENT_S + GONE_S) == {"a": False}
    board.report("a", health("a"), SILENT_S + GONE_S)
    assert up(board, SILENT_S + GONE_S) == {"a": True}


def test_a_node_without_a_token_is_forgotten_too(board: Board):
    board.report("a", health("a"), 0.0)
    assert up(board, SILENT_S + GONE_S + 0.1) == {}


def test_the_end_of_an_unknown_token_is_nothing(board: Board):
    board.went("a", 0.0)
    assert board.nodes(0.0) == []


def test_health_on_the_key_of_another_node_is_refused(board: Board):
    with pytest.raises(PayloadError, match="health of 'b' on the key of 'a'") as caught:
        board.report("a", health("b"), 0.0)
    assert caught.value.reason == "wrong_node"
    assert board.nodes(0.0) == []


def test_a_description_of_another_node_is_refused(board: Board):
    board.came("a", 0.0)
    with pytest.raises(PayloadError, match="'a' describes itself as 'b'"):
        board.describe("a", description("b"))


def test_only_nodes_that_are_up_and_have_not_said_are_asked_who_they_are(board: Board):
    for node in ("a", "b", "c"):
        board.came(node, 0.0)
    board.describe("a", description("a"))
    board.went("b", 1.0)
    assert board.undescribed() == ["c"]
    board.describe("b", description("b"))
    assert up(board, 1.0)["b"] is False


def test_there_is_a_limit_to_nodes_and_those_known_go_on(board: Board):
    for n in range(MAX_NODES):
        board.report(f"n{n}", health(f"n{n}"), 0.0)
    with pytest.raises(PayloadError, match="more than 1000 nodes"):
        board.report("more", health("more"), 0.0)
    with pytest.raises(PayloadError, match="too_many"):
        board.came("more", 0.0)
    board.report("n7", health("n7", level=2), 1.0)
    assert len(board.nodes(1.0)) == MAX_NODES


def test_there_is_a_limit_to_the_counters_of_a_node(board: Board):
    counters = {f"c{n}": n for n in range(MAX_COUNTERS + 1)}
    with pytest.raises(PayloadError, match="101 counters of 'a'"):
        board.report("a", health("a", counters=counters), 0.0)


def test_what_was_rejected_is_counted_by_reason(board: Board):
    for reason in ("bad_message", "wrong_node", "bad_message"):
        board.reject(PayloadError(reason, "x"))
    assert board.rejected() == {"bad_message": 2, "wrong_node": 1}


def test_nodes_are_in_the_order_of_their_names(board: Board):
    for node in ("b", "c", "a"):
        board.came(node, 0.0)
    assert list(up(board, 0.0)) == ["a", "b", "c"]
