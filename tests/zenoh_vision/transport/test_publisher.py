"""When a payload is made, sent, withheld and kept, and what a query gets."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import zenoh

from zenoh_vision.errors import PayloadError
from zenoh_vision.topics import Topic
from zenoh_vision.transport.publisher import (
    RECENT_BYTES,
    Demand,
    Outgoing,
    StreamPublisher,
)


class Matched:
    """What is declared with Zenoh, which says whether someone subscribes."""

    def __init__(self, *, wanted: bool = False) -> None:
        self.wanted = wanted

    def declare_matching_listener(self, told: Any) -> None:
        self._told = told.callback
        if self.wanted:
            self.tell(wanted=True)

    def tell(self, *, wanted: bool) -> None:
        self._told(SimpleNamespace(matching=wanted))


def test_demand_is_what_zenoh_says_of_the_publisher_of_the_session_in_use():
    demand, former, present = Demand(), Matched(wanted=True), Matched()
    demand.of(cast("Any", former))
    assert not demand.exists
    demand.follow_newest()
    assert demand.exists
    demand.of(cast("Any", present))
    former.tell(wanted=False)
    assert not demand.exists
    former.tell(wanted=True)
    assert demand.exists
    demand.follow_newest()
    assert not demand.exists
    former.tell(wanted=True)
    assert not demand.exists
    present.tell(wanted=True)
    assert demand.exists
    former.tell(wanted=False)
    assert demand.exists
    present.tell(wanted=False)
    assert not demand.exists


class Declared:
    """A link whose publisher records what is put."""

    def __init__(self, *, wanted: bool = True) -> None:
        self.put_payloads: list[bytes] = []
        self.wanted = wanted
        self.session: Any = SimpleNamespace(
            new_timestamp=lambda: None,
            declare_publisher=self._publisher,
            declare_queryable=lambda *_, **__: None,
        )

    def declare(self, declare: Any, used: Any = lambda: None) -> Any:
        self.current = declare(self.session) or self.current
        used()
        return self

    def _publisher(self, *_: object, **__: object) -> Any:
        publisher: Any = Matched(wanted=self.wanted)
        publisher.put = self._put
        return publisher

    def _put(self, payload: bytes, **_options: object) -> None:
        self.put_payloads.append(payload)


class Asked:
    """A query that records its replies."""

    def __init__(self, **parameters: str) -> None:
        self.parameters = parameters
        self.replies: list[bytes] = []
        self.errors: list[bytes] = []

    def reply(self, _key: str, payload: bytes, **_options: object) -> None:
        self.replies.append(payload)

    def reply_err(self, payload: bytes, **_options: object) -> None:
        self.errors.append(payload)


def publisher_of(link: Declared, *, recent: int = 0, **options: Any) -> StreamPublisher:
    topic = Topic("image/compressed", "image/jpeg", recent=recent)
    return StreamPublisher(cast("Any", link), topic, "a/b/c", lambda *_: None, **options)


def asked_of(publisher: StreamPublisher, **parameters: str) -> Asked:
    query = Asked(**parameters)
    publisher.answer(cast("Any", query))
    return query


def outgoing(payload: bytes, *, answers: bool = True) -> Outgoing:
    return Outgoing(payload, "image/jpeg", answers=answers)


def test_what_nobody_wants_is_not_made_before_a_query_asks_for_it():
    made: list[int] = []
    link = Declared(wanted=False)
    publisher = publisher_of(link)
    assert publisher.offer(lambda: made.append(1) or outgoing(b"x")) == "unwanted"
    assert (made, link.put_payloads) == ([], [])
    assert asked_of(publisher).replies == asked_of(publisher).replies == [b"x"]
    assert made == [1]


def test_what_is_withheld_is_neither_sent_nor_kept():
    link = Declared()
    publisher = publisher_of(link)
    assert publisher.offer(lambda: outgoing(b"old")) == "sent"
    assert publisher.offer(lambda: outgoing(b"full"), lambda: None) == "withheld"
    assert publisher.offer(lambda: outgoing(b"full"), lambda: outgoing(b"small")) == "sent"
    assert link.put_payloads == [b"old", b"small"]
    assert asked_of(publisher).replies == [b"small"]


def test_a_payload_that_needs_those_before_it_answers_no_query():
    publisher = publisher_of(Declared())
    publisher.offer(lambda: outgoing(b"key frame"))
    publisher.offer(lambda: outgoing(b"difference", answers=False))
    assert asked_of(publisher).replies == [b"key frame"]


def test_a_payload_that_cannot_be_made_is_an_error_reply_and_tried_once():
    tried: list[int] = []
    reported: list[str] = []

    def make() -> Outgoing:
        tried.append(1)
        raise PayloadError("corrupt", "no end")

    publisher = publisher_of(
        Declared(wanted=False), report=lambda error: reported.append(error.reason)
    )
    publisher.offer(make)
    assert [asked_of(publisher).errors for _ in range(2)] == [[b"a/b/c: corrupt: no end"]] * 2
    assert (tried, reported) == ([1], ["corrupt"] * 2)


def test_a_reply_over_its_limit_is_an_error_that_says_why():
    publisher = publisher_of(Declared(wanted=False))
    publisher.limit = lambda size: "later" if size > 2 else None
    publisher.offer(lambda: outgoing(b"long"))
    assert asked_of(publisher).errors == [b"later"]
    publisher.offer(lambda: outgoing(b"s"))
    assert asked_of(publisher).replies == [b"s"]


def test_a_put_on_a_session_that_was_replaced_meanwhile_goes_to_the_new_one():
    link = Declared()
    publisher = publisher_of(link)
    good = link.current

    def put_while_it_is_replaced(_payload: bytes, **_options: object) -> None:
        link.current = good
        raise zenoh.ZError("the session is closed")

    link.current = SimpleNamespace(put=put_while_it_is_replaced)
    assert publisher.offer(lambda: outgoing(b"x")) == "sent"
    assert link.put_payloads == [b"x"]


def test_a_query_that_names_a_frame_gets_its_payload_while_it_is_kept_and_else_the_newest():
    publisher = publisher_of(Declared(), recent=3)
    for seq in range(5):
        publisher.offer(lambda seq=seq: outgoing(b"%d" % seq), frame=(7, seq))
    for seq, answer in enumerate([b"4", b"4", b"2", b"3", b"4"]):
        assert asked_of(publisher, epoch="7", seq=f"{seq}").replies == [answer]
    assert asked_of(publisher, epoch="8", seq="2").replies == [b"4"]
    assert asked_of(publisher, seq="2").replies == asked_of(publisher).replies == [b"4"]


def test_recent_frames_that_are_not_encoded_take_only_a_part_of_the_memory():
    link = Declared(wanted=False)
    publisher = publisher_of(link, recent=10)
    for seq in range(10):
        payload = b"%d" % seq
        held = RECENT_BYTES // 3
        publisher.offer(lambda payload=payload: outgoing(payload), frame=(7, seq), held=held)
    assert asked_of(publisher, epoch="7", seq="7").replies == [b"7"]
    assert asked_of(publisher, epoch="7", seq="6").replies == [b"9"]
    huge = lambda: outgoing(b"huge")  # noqa: E731
    publisher.offer(huge, frame=(7, 10), held=2 * RECENT_BYTES)
    assert asked_of(publisher, epoch="7", seq="9").replies == [b"huge"]
