"""Queries are answered one after the other, and the server ends in time."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace

import pytest
import zenoh

from tests.support.waiting import wait_until
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.messages import Centroid, Refusal
from zenoh_vision.node.query_server import (
    MAX_WAITING_BYTES,
    MAX_WAITING_QUERIES,
    QueryServer,
    schema_answer,
)


class Query:
    """What the server needs of a query."""

    def __init__(self, payload: bytes | None = None) -> None:
        self.payload = payload
        self.errors: list[bytes] = []
        self.encodings: list[str] = []

    def __enter__(self) -> Query:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def reply_err(self, payload: bytes, encoding: str) -> None:
        self.errors.append(payload)
        self.encodings.append(encoding)


def test_close_does_not_wait_for_a_full_queue():
    server = QueryServer()
    working, go_on = threading.Event(), threading.Event()

    def answer(_query: object) -> None:
        working.set()
        assert go_on.wait(10)

    server.queue(Query(), answer)  # type: ignore[arg-type]
    server.start()
    assert working.wait(5)
    for _ in range(MAX_WAITING_QUERIES):
        server.queue(Query(), answer)  # type: ignore[arg-type]
    refused = Query()
    server.queue(refused, answer)  # type: ignore[arg-type]
    assert refused.errors == [b"busy: too many queries are waiting"]
    closing = threading.Thread(target=server.close)
    began_s = time.monotonic()
    closing.start()
    closing.join(10)
    assert not closing.is_alive()
    go_on.set()
    server._thread.join(5)
    assert not server._thread.is_alive(), "it answers the whole queue before it ends"
    assert time.monotonic() - began_s < 10


def test_queries_that_wait_are_limited_in_bytes_and_the_limit_is_for_those_that_wait():
    server = QueryServer()
    half = bytes(MAX_WAITING_BYTES // 2)
    answered: list[object] = []
    waiting = [Query(half), Query(half)]
    for query in waiting:
        server.queue(query, answered.append)  # type: ignore[arg-type]
    refused, small = Query(b"x"), Query()
    for query in (refused, small):
        server.queue(query, answered.append)  # type: ignore[arg-type]
    assert refused.errors == [b"busy: too many queries are waiting"]
    server.start()
    wait_until(lambda: answered == [*waiting, small])
    server.queue(refused, answered.append)  # type: ignore[arg-type]
    wait_until(lambda: answered[-1] is refused)
    server.close()


def test_a_refusal_is_an_error_reply_and_the_next_query_is_answered():
    def refuse(_query: object) -> None:
        raise ParameterRefused("rate = 0", "above 0")

    server = QueryServer()
    asked, answered = Query(), threading.Event()
    server.queue(asked, refuse)  # type: ignore[arg-type]
    server.queue(Query(), lambda _query: answered.set())  # type: ignore[arg-type]
    server.start()
    assert answered.wait(5)
    server.close()
    assert asked.encodings == ["application/msgpack;vision.Refusal.v1"]
    assert Refusal.from_bytes(asked.errors[0]) == Refusal(error="rate = 0", allowed="above 0")


@pytest.mark.parametrize(
    ("error", "said"),
    [
        pytest.param(
            ParameterRefused("rate = 0", ["1", "2"]),  # type: ignore[arg-type]
            b"ValidationError: 1 validation error for Refusal",
            id="a refusal that is no message",
        ),
        pytest.param(ValueError("a file \udcff"), b"ValueError: a file ?", id="no Unicode"),
    ],
)
def test_an_error_of_any_words_is_replied_and_the_next_query_is_answered(
    error: Exception, said: bytes
):
    def fail(_query: object) -> None:
        raise error

    server = QueryServer()
    asked, answered = Query(), threading.Event()
    server.queue(asked, fail)  # type: ignore[arg-type]
    server.queue(Query(), lambda _query: answered.set())  # type: ignore[arg-type]
    server.start()
    assert answered.wait(5)
    server.close()
    assert asked.errors[0].startswith(said)


def test_the_schema_of_a_message_is_made_once_however_often_it_is_asked_for(monkeypatch):
    made: list[type] = []

    def schema(cls: type, *_: object) -> dict[str, str]:
        made.append(cls)
        return {"title": cls.__name__}

    monkeypatch.setattr(Centroid, "model_json_schema", classmethod(schema))
    replies: list[tuple[str, str]] = []
    query = SimpleNamespace(
        key_expr=zenoh.KeyExpr("@vision/schema/*"),
        reply=lambda key, text, encoding: replies.append((str(key), text)),
    )
    answer = schema_answer("vision", lambda: [Centroid])
    for _ in range(100):
        answer(query)  # type: ignore[arg-type]
    assert len(made) == 1
    assert set(replies) == {
        ("@vision/schema/vision.Centroid.v1", '{"title": "Centroid"}'),
        ("@vision/schema/Centroid", '{"title": "Centroid"}'),
    }
