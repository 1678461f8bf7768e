"""What a session does with the commands of its page, and in which order it sends."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Hashable
from types import SimpleNamespace
from typing import Any

from tests.support.waiting import DEADLINE_S
from zv.viewer.credentials import Principal, Scope
from zv.viewer.discovery.system_state import SystemState
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

    async def until_sent(self, op: str) -> None:
        """Wait for a text of this kind."""
        async with asyncio.timeout(DEADLINE_S):
            while not any(isinstance(one, str) and f'"op":"{op}"' in one for one in self.sent):
                self.changed.clear()
                await self.changed.wait()


def a_session(socket: Any, system: Any) -> WebSocketSession:
    """Return the session of a page that shows no panel."""

    async def drain() -> None:
        pass

    request: Any = SimpleNamespace(
        headers={}, remote="", query={"show": ""}, writer=SimpleNamespace(drain=drain)
    )
    monitor: Any = SimpleNamespace(system=system)
    nothing: Any = None
    principal = Principal(Scope.VIEW, "a page")
    return WebSocketSession(socket, request, nothing, monitor, principal, nothing)


def test_of_many_commands_to_show_the_last_counts_and_the_others_cost_nothing(monkeypatch):
    made: list[set[str]] = []
    overview = SystemState.overview

    def counted(self: SystemState, kinds: Any, **options: bool) -> list[tuple[str, Hashable]]:
        made.append(set(kinds))
        return overview(self, kinds, **options)

    monkeypatch.setattr(SystemState, "overview", counted)

    async def test() -> None:
        shows = [{"op": "show", "kinds": kinds} for kinds in (["matches"], ["health"]) * 20]
        socket = Socket(*shows, {"op": "show", "kinds": ["log", "matches"]})
        session = a_session(socket, SystemState("vision", lambda text, replaces: None))
        serving = asyncio.create_task(session.serve())
        await socket.until_sent("matches")
        assert made == [{"log", "matches"}]
        assert session.shows == {"log", "matches"}
        serving.cancel()

    asyncio.run(test())
