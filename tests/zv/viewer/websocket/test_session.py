"""What a session does with the commands of its page, and in which order it sends."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Hashable
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from tests.support.headers import header
from tests.support.waiting import DEADLINE_S
from zv.viewer.credentials import Principal, Scope
from zv.viewer.discovery.system_state import SystemState
from zv.viewer.streams.message_stream import QUEUE, MessageFeed
from zv.viewer.streams.rendering import EncodedPicture
from zv.viewer.websocket import sender
from zv.viewer.websocket.link_gauge import WINDOW_S
from zv.viewer.websocket.sender import PART_BYTES
from zv.viewer.websocket.session import WebSocketSession


class Socket:
    """A page's WebSocket: what the page says at once, and what it is sent."""

    def __init__(self, *commands: dict[str, Any]) -> None:
        self._commands = commands
        self.sent: list[str | bytes] = []
        self.changed = asyncio.Event()

    async def __aiter__(self) -> AsyncIterator[SimpleNamespace]:
        for command in self._commands:
            yield SimpleNamespace(data=json.dumps(command))
        await asyncio.Event().wait()

    async def send_str(self, text: str) -> None:
        self.sent.append(text)
        self.changed.set()

    async def send_bytes(self, data: bytes) -> None:
        self.sent.append(data)
        self.changed.set()

    @property
    def parts(self) -> list[int]:
        """The indices of the parts of pictures in what was sent."""
        return [index for index, each in enumerate(self.sent) if isinstance(each, bytes)]

    async def until(self, true: Callable[[], bool]) -> None:
        """Wait until a condition holds for what was sent."""
        async with asyncio.timeout(DEADLINE_S):
            while not true():
                self.changed.clear()
                await self.changed.wait()

    async def until_sent(self, op: str) -> None:
        """Wait for a text of this kind."""
        await self.until(lambda: any(f'"op":"{op}"' in str(each) for each in self.sent))


def a_session(socket: Any, system: Any, registry: Any = None) -> WebSocketSession:
    """Return the session of a page that shows no panel."""

    async def drain() -> None:
        pass

    request: Any = SimpleNamespace(
        headers={}, remote="", query={"show": ""}, writer=SimpleNamespace(drain=drain)
    )
    monitor: Any = SimpleNamespace(system=system)
    nothing: Any = None
    principal = Principal(Scope.VIEW, "a page")
    return WebSocketSession(socket, request, registry, monitor, principal, nothing)


class Registry:
    """A registry with one picture of 20 parts, and with streams of which many messages wait."""

    def __init__(self, message: str) -> None:
        self._message = message
        self._picture: list[EncodedPicture] = [A_PICTURE]

    def pictures(self, *_: object) -> Any:
        return SimpleNamespace(
            take=lambda: self._picture.pop() if self._picture else None,
            want=lambda: None, close=lambda: None, skipped=0, lost=0,
            stream=SimpleNamespace(ended_ns=None),
        )  # fmt: skip

    def messages(self, key: str, ready: asyncio.Event, _: int) -> MessageFeed:
        stream: Any = SimpleNamespace(feeds=set(), closed=True)
        feed = MessageFeed(stream, ready)
        for _ in range(QUEUE):
            feed.put(f"{key} {self._message}")
        return feed


A_PICTURE = EncodedPicture("v/front/image", header(7), bytes(20 * PART_BYTES), "image/jpeg", 1, 1)


async def test_of_many_commands_to_show_the_last_counts_and_the_others_cost_nothing(monkeypatch):
    made: list[set[str]] = []
    overview = SystemState.overview

    def counted(self: SystemState, kinds: Any, **options: bool) -> list[tuple[str, Hashable]]:
        made.append(set(kinds))
        return overview(self, kinds, **options)

    monkeypatch.setattr(SystemState, "overview", counted)
    shows = [{"op": "show", "kinds": kinds} for kinds in (["matches"], ["health"]) * 20]
    socket = Socket(*shows, {"op": "show", "kinds": ["log", "matches"]})
    session = a_session(socket, SystemState("vision", lambda text, replaces: None))
    serving = asyncio.create_task(session.serve())
    await socket.until_sent("matches")
    assert made == [{"log", "matches"}]
    assert session.shows == {"log", "matches"}
    serving.cancel()


async def test_a_page_is_sent_of_the_panels_those_that_it_shows():
    socket = Socket({"op": "show", "kinds": ["log"]})
    session = a_session(socket, SystemState("vision", lambda text, replaces: None))
    session.send("early line", ("log", 1))
    session.send("of everybody", "nodes")
    serving = asyncio.create_task(session.serve())
    while session.shows != {"log"}:  # the deadline is run's
        await asyncio.sleep(0.01)
    for text, replaces in (("health", ("health", "a")), ("line", ("log", 2)), ("last", None)):
        session.send(text, replaces)
    await socket.until(lambda: "last" in socket.sent)
    assert socket.sent == ["of everybody", "line", "last"]
    serving.cancel()


@pytest.mark.parametrize(("message_bytes", "texts"), [(64 << 10, 0), (100, 0), (500, 1000)])
async def test_between_two_parts_of_a_picture_other_things_are_as_much_as_a_part(
    message_bytes, texts
):
    keys = [f"vision/c{number}/tracks" for number in range(7)]
    watches = [{"op": "watch", "key": key} for key in ("vision/front/image/compressed", *keys)]
    socket = Socket(*watches)
    system = SystemState("vision", lambda text, replaces: None)
    session = a_session(socket, system, Registry("x" * message_bytes))
    for number in range(texts):
        session.send(f"text {number} {'x' * 1000}")
    serving = asyncio.create_task(session.serve())
    await socket.until(lambda: len(socket.parts) > 20)
    serving.cancel()
    parts = socket.parts
    apart = [socket.sent[a + 1 : b] for a, b in pairwise(parts)]
    largest = message_bytes + 1100  # what begins below the limit may go beyond it
    assert max(sum(map(len, each)) for each in apart) < PART_BYTES + largest
    between = [str(each).split()[0] for each in socket.sent[: parts[-1]]]
    counts = [between.count(key) for key in keys]
    assert max(counts) <= min(counts) + 1
    assert min(counts) >= 2  # texts do not keep messages back


async def test_a_link_that_only_texts_wait_for_is_measured_too(monkeypatch):
    clock = SimpleNamespace(now_s=0.0, monotonic=lambda: clock.now_s, time_ns=lambda: 0)
    monkeypatch.setattr(sender, "time", clock)
    socket = Socket()
    send_str = socket.send_str

    async def slow(text: str) -> None:
        clock.now_s += WINDOW_S / 4
        await send_str(text)

    monkeypatch.setattr(socket, "send_str", slow)
    session = a_session(socket, SystemState("vision", lambda text, replaces: None))
    for _ in range(4):
        session.send("x" * 1000)
    serving = asyncio.create_task(session.serve())
    await socket.until_sent("link")
    assert json.loads(socket.sent[4]) == {"op": "link", "bits_per_s": 8 * 4000 / WINDOW_S}
    serving.cancel()
