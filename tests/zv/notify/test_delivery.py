"""Notices reach their receivers again until they are taken, and are given up when too old."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress

import pytest

from tests.support.waiting import wait_until
from zv.notify import delivery, webhook
from zv.notify.delivery import MOST_WAITING, STOP_S, Delivery, NotTaken, Receiver, Refused
from zv.notify.mqtt import Mqtt
from zv.notify.notice import Notice
from zv.notify.webhook import Webhook


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delivery, "FIRST_DELAY_S", 0.02)


class Listed:
    """A receiver that does what it is told with each notice."""

    def __init__(
        self, name: str, take: Callable[[int], None], *, shows_state: bool = False
    ) -> None:
        self.name = name
        self.shows_state = shows_state
        self.kept = 0
        self.taken: list[str] = []
        self.tried = 0
        self._take = take

    async def keep(self) -> None:
        self.kept += 1
        if self.kept == 1:
            raise NotTaken("nobody listens")

    async def send(self, notice: Notice) -> None:
        self.tried += 1
        self._take(self.tried)
        self.taken.append(notice.id)

    async def close(self) -> None:
        pass


def notice(number: int) -> Notice:
    return Notice({"uid": str(number), "camera": "front"})


def fails_first(times: int) -> Callable[[int], None]:
    def take(tried: int) -> None:
        if tried <= times:
            raise NotTaken("busy at http://me:secret@host/")

    return take


def test_a_receiver_that_fails_gets_it_again_in_order_and_delays_no_other():
    slow, quick = Listed("slow", fails_first(3)), Listed("quick", lambda _: None)
    lost: list[None] = []
    with Delivery([slow, quick], lambda: 60, lambda: lost.append(None)) as sending:
        for number in range(3):
            sending.put(notice(number))
        wait_until(lambda: quick.taken == ["0", "1", "2"])
        wait_until(lambda: slow.taken == ["0", "1", "2"])
        assert slow.tried == 6
        assert (sending.fault, lost) == ("", [])


def test_why_it_waits_is_told_without_the_password():
    never = Listed("webhook", fails_first(10**6))
    with Delivery([never], lambda: 60, lambda: None) as sending:
        sending.put(notice(1))
        wait_until(lambda: sending.fault)
        assert sending.fault.startswith("webhook: busy at http://***@host")


@pytest.mark.parametrize("keep_trying_s", [0.0, 0.1])
def test_what_is_too_old_is_given_up_and_counted_and_the_next_one_is_sent(keep_trying_s: float):
    receiver = Listed("webhook", fails_first(2 if not keep_trying_s else 10**6))
    lost: list[None] = []
    with Delivery([receiver], lambda: keep_trying_s, lambda: lost.append(None)) as sending:
        for number in range(3):
            sending.put(notice(number))
        wait_until(lambda: len(lost) + len(receiver.taken) == 3)
        assert receiver.taken == (["2"] if not keep_trying_s else [])


def test_what_is_refused_is_not_sent_again():
    def refuse(_: int) -> None:
        raise Refused("it answers 404 Not Found")

    receiver = Listed("webhook", refuse)
    lost: list[None] = []
    with Delivery([receiver], lambda: 60, lambda: lost.append(None)) as sending:
        sending.put(notice(1))
        wait_until(lambda: lost)
    assert receiver.tried == 1


@pytest.mark.quiet
def test_the_newest_are_kept_while_a_receiver_hangs_and_the_end_is_in_bounded_time():
    hanging = asyncio.Event()

    class Hanging(Listed):
        async def send(self, notice: Notice) -> None:
            await hanging.wait()

    lost: list[None] = []
    with Delivery(
        [Hanging("webhook", lambda _: None)], lambda: 60, lambda: lost.append(None)
    ) as one:
        for number in range(MOST_WAITING + 31):
            one.put(notice(number))
        wait_until(lambda: len(lost) >= 30)
        began_s = time.monotonic()
    assert time.monotonic() - began_s < 2.5


def test_a_request_is_ended_before_its_connection_is_closed():
    class Request(Listed):
        closed = False

        async def send(self, notice: Notice) -> None:
            self.tried += 1
            try:
                await asyncio.Event().wait()
            except asyncio.CancelledError:
                await asyncio.sleep(0.05)  # a library that cleans up
                if self.closed:
                    raise NotTaken("the connection is closed") from None
                raise

        async def close(self) -> None:
            self.closed = True

    receiver = Request("webhook", lambda _: None)
    with Delivery([receiver], lambda: 60, lambda: None) as sending:
        sending.put(notice(0))
        wait_until(lambda: receiver.tried)
        assert not sending.fault
    assert (receiver.closed, receiver.tried, sending.fault) == (True, 1, "")


@pytest.mark.parametrize("fails", [False, True])
def test_it_ends_although_a_library_loses_the_cancellation(fails: bool):
    class Deaf(Listed):
        async def send(self, notice: Notice) -> None:
            self.tried += 1
            with suppress(asyncio.CancelledError):
                await asyncio.Event().wait()
            if fails:
                raise NotTaken("busy")

    receiver = Deaf("webhook", lambda _: None)
    with Delivery([receiver], lambda: 60, lambda: None) as sending:
        sending.put(notice(0))
        sending.put(notice(1))
        wait_until(lambda: receiver.tried)
        began_s = time.monotonic()
    assert time.monotonic() - began_s < STOP_S / 2
    assert receiver.tried == 1


def test_what_a_slow_receiver_does_not_get_is_named_while_it_waits_and_at_the_end(
    caplog: pytest.LogCaptureFixture,
):
    class Hanging(Listed):
        async def send(self, notice: Notice) -> None:
            self.tried += 1
            await asyncio.Event().wait()

    receiver = Hanging("webhook", lambda _: None)
    with Delivery([receiver], lambda: 60, lambda: None) as sending:
        sending.put(notice(0))
        wait_until(lambda: receiver.tried)
        for number in range(1, MOST_WAITING + 3):
            sending.put(notice(number))
        wait_until(lambda: sending.fault == "webhook: 100 events wait for it")
        wait_until(lambda: len(caplog.messages) == 2)
    assert caplog.messages == [
        "webhook did not get 1: 100 events wait for it",
        "webhook did not get 2: 100 events wait for it",
        "webhook has not taken the last 101 events",
    ]


def test_what_shows_the_state_is_connected_without_an_event_and_gets_what_is_not_announced(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(delivery, "KEEP_S", 0.2)
    shows = Listed("mqtt", lambda _: None, shows_state=True)
    other = Listed("webhook", lambda _: None)
    with Delivery([shows, other], lambda: 60, lambda: None) as sending:
        wait_until(lambda: sending.fault == "mqtt: nobody listens")
        wait_until(lambda: shows.kept > 2 and not sending.fault)
        sending.put(Notice({"uid": "0", "camera": "front"}, announced=False))
        sending.put(notice(1))
        wait_until(lambda: (shows.taken, other.taken) == (["0", "1"], ["1"]))
    assert other.kept == 0


@pytest.mark.parametrize(
    ("answer", "said"),
    [(b"hello\r\n\r\n", "its answer is not HTTP: Bad status line"), (None, "names no host")],
)
def test_what_is_wrong_with_a_webhook_is_told_without_its_url(answer: bytes | None, said: str):
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            with suppress(OSError):
                while True:
                    caller, _ = server.accept()
                    with caller, caller.makefile("rb") as request:
                        next((each for each in request if each.endswith(b"--\r\n")), b"")
                        caller.sendall(answer or b"")

        threading.Thread(target=serve, daemon=True).start()
        host = "" if answer is None else "127.0.0.1"
        hook = Webhook(f"http://{host}:{server.getsockname()[1]}/secret")
        with Delivery([hook], lambda: 60, lambda: None) as sending:
            sending.put(notice(0))
            wait_until(lambda: sending.fault)
            assert said in sending.fault
            assert "secret" not in sending.fault
        server.shutdown(socket.SHUT_RDWR)


def test_a_webhook_that_does_not_answer_is_said_to_be_so(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(webhook, "ANSWER_S", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as server:  # the system accepts, nobody reads
        hook = Webhook(f"http://127.0.0.1:{server.getsockname()[1]}/")
        with Delivery([hook], lambda: 60, lambda: None) as sending:
            sending.put(notice(0))
            wait_until(lambda: sending.fault)
            assert sending.fault == "webhook: it does not answer within 0.2 s"


def test_an_error_that_no_receiver_foresees_is_told_and_it_is_sent_again():
    def take(tried: int) -> None:
        if tried <= 2:
            raise LookupError("at http://me:secret@host/")

    receiver = Listed("webhook", take)
    with Delivery([receiver], lambda: 60, lambda: None) as sending:
        sending.put(notice(0))
        wait_until(lambda: sending.fault)
        assert sending.fault.startswith("webhook: LookupError: at http://***@host")
        wait_until(lambda: receiver.taken == ["0"])
        sending.put(notice(1))
        wait_until(lambda: receiver.taken == ["0", "1"])


@pytest.mark.parametrize(
    "receiver",
    [Webhook("http://a..b/"), Mqtt("mqtt://a..b", "zv", "", "notify_front")],
    ids=["webhook", "mqtt"],
)
def test_a_host_that_cannot_exist_is_told_and_its_events_are_given_up_in_time(receiver: Receiver):
    lost: list[None] = []
    with Delivery([receiver], lambda: 0.1, lambda: lost.append(None)) as sending:
        for number in range(2):
            sending.put(notice(number))
        wait_until(lambda: len(lost) == 2)
        assert sending.fault.startswith(f"{receiver.name}: ")
