"""Which clients are left: those that take nothing, not those that take it slowly."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from zv.viewer.http import connections
from zv.viewer.http.connections import LEFT_S, PROGRESS_S, Connection


class Client:
    """A client that takes so many bytes between two looks at it, by a clock of its own."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, takes: int) -> None:
        self.at_s = 0.0
        self.unsent = 1_000_000
        self.takes = takes
        self.gone = False
        inner: Any = SimpleNamespace(pause_writing=lambda: None, resume_writing=lambda: None)
        self.connection = Connection(inner, {})
        self.connection._transport = self  # type: ignore[assignment]
        self.connection._layers = (self,)  # type: ignore[assignment]
        self.connection._deadline = SimpleNamespace(cancel=lambda: None)  # type: ignore[assignment]
        monkeypatch.setattr(connections, "time", SimpleNamespace(monotonic=lambda: self.at_s))
        loop = SimpleNamespace(call_later=self._call_later)
        fake = SimpleNamespace(get_running_loop=lambda: loop, TimerHandle=asyncio.TimerHandle)
        monkeypatch.setattr(connections, "asyncio", fake)

    def _call_later(self, delay_s: float, call: Any) -> Any:
        assert delay_s == PROGRESS_S
        self.next = call
        return SimpleNamespace(cancel=lambda: None)

    def get_write_buffer_size(self) -> int:
        return self.unsent

    def abort(self) -> None:
        self.gone = True

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / PROGRESS_S)):
            self.at_s += PROGRESS_S
            self.unsent -= self.takes
            self.next()
            if self.gone:
                return


def test_a_client_that_takes_nothing_is_left_after_a_while(monkeypatch):
    client = Client(monkeypatch, takes=0)
    client.connection.pause_writing()
    client.wait(LEFT_S)
    assert (client.gone, client.connection.stalled_s) == (False, LEFT_S)
    client.wait(1)
    assert client.gone


def test_a_client_on_a_slow_link_is_not_left_however_long_a_picture_takes(monkeypatch):
    client = Client(monkeypatch, takes=100)
    client.connection.pause_writing()
    client.wait(20 * LEFT_S)
    assert not client.gone
    assert client.connection.stalled_s == 0
