"""How much of what replies is kept."""

from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from zenoh_vision.transport import query as query_module
from zenoh_vision.transport.query import MAX_REPLIES, Query, Replies, ask, send


def session_of(sizes: list[int], good: bool = True) -> Any:
    """Return a session in which a query gets replies with payloads of these sizes."""

    def get(_key: str, handler: Any, **_options: object) -> None:
        for size in sizes:
            said = SimpleNamespace(payload=bytes(size), key_expr="v/front/image")
            ok, err = (said, None) if good else (None, said)
            handler.callback(SimpleNamespace(ok=ok, err=err, replier_id=None))
        handler.drop()

    return SimpleNamespace(get=get)


def replies_of(sizes: list[int], most_bytes: int, good: bool = True) -> Replies:
    """Ask what replies with payloads of these sizes; return what is kept."""
    kept: list[Replies] = []
    query = Query("v/front/image", most_bytes=most_bytes)
    send(session_of(sizes, good), query, kept.append)
    (found,) = kept
    return found


def test_endless_replies_are_kept_up_to_a_size_and_the_first_of_any_size():
    assert len(replies_of([100_000] * 500, 1_000_000)) == 9
    assert len(replies_of([2_000_000] * 20, 1_000_000)) == 1
    assert len(replies_of([0] * 5_000, 1_000_000)) == 1000  # each costs some memory itself
    assert len(replies_of([10, 20], 1_000_000)) == 2
    assert replies_of([10, 20], 1_000_000).left_out == 0


@pytest.mark.parametrize("good", [True, False])
@pytest.mark.parametrize("position", [0, 3])
def test_a_reply_over_the_limit_hides_no_smaller_ones(position: int, good: bool):
    sizes = [300] * 50
    sizes.insert(position, 70_000_000)
    found = replies_of(sizes, 1_000_000, good)
    assert len(found) == (51 if position == 0 else 50)
    assert found.left_out == (position != 0)


def test_the_number_of_replies_left_out_is_logged(caplog: pytest.LogCaptureFixture):
    many = [0] * (MAX_REPLIES + 7)
    assert len(replies_of(many, 1 << 40)) == MAX_REPLIES
    assert replies_of(many, 1 << 40).left_out == 7
    assert len(replies_of([900_000] * 3, 2_000_000, good=False)) == 2
    asked = ask(session_of([400_000] * 5), [Query("v/front/image", most_bytes=1_000_000)])
    assert [len(replies) for replies in asked] == [2]
    assert caplog.messages == ["v/front/image: 3 more replies are left out"]


def test_an_incomplete_list_of_tokens_is_logged(caplog: pytest.LogCaptureFixture):
    def get(_key: str, handler: Any, **_options: object) -> None:
        err = SimpleNamespace(payload=zenoh.ZBytes(b"Timeout"))  # as Zenoh 1.10 sends it
        handler.callback(SimpleNamespace(ok=None, err=err, replier_id=None))
        handler.drop()

    session: Any = SimpleNamespace(liveliness=lambda: SimpleNamespace(get=get), get=get)
    assert ask(session, [Query("v/front/image")]) == [[]]
    assert caplog.messages == []  # a queryable that does not reply is found in other ways
    assert ask(session, [Query("@v/node/*", timeout_s=2.5, tokens=True)]) == [[]]
    assert caplog.messages == ["@v/node/*: the router has not listed all tokens within 2.5 s"]


def test_a_query_that_its_session_never_completes_ends_by_time(monkeypatch: pytest.MonkeyPatch):
    """So does one of a session that is closed before the replies have come."""
    monkeypatch.setattr(query_module, "LATE_S", 0.0)
    silent: Any = SimpleNamespace(get=lambda *_arguments, **_options: None)
    (found,) = ask(silent, [Query("v/front/image", timeout_s=0.01)])
    assert found == []
