"""How much of what replies is kept."""

from types import SimpleNamespace
from typing import Any

from zenoh_vision.transport.query import Query, Reply, send


def replies_of(sizes: list[int], most_bytes: int) -> list[Reply]:
    """Ask what replies with payloads of these sizes; return what is kept."""
    kept: list[list[Reply]] = []

    def get(_key: str, handler: Any, **_options: object) -> None:
        for size in sizes:
            sample = SimpleNamespace(payload=bytes(size), key_expr="v/front/image")
            handler.callback(SimpleNamespace(ok=sample, err=None, replier_id=None))
        handler.drop()

    session: Any = SimpleNamespace(get=get)
    send(session, Query("v/front/image", most_bytes=most_bytes), kept.append)
    (found,) = kept
    return found


def test_endless_replies_are_kept_up_to_a_size_and_the_first_of_any_size():
    assert len(replies_of([100_000] * 500, 1_000_000)) == 9
    assert len(replies_of([2_000_000] * 20, 1_000_000)) == 1
    assert len(replies_of([0] * 5_000, 1_000_000)) == 1000  # each costs some memory itself
    assert len(replies_of([10, 20], 1_000_000)) == 2
