"""Stands in for a node: what it says of itself is said by the test. Plain Zenoh and msgpack."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from typing import Any

import msgpack
import zenoh

DAY_S = 24 * 3600


class StandIn:
    """A token, a description and health, for as long as its session is open.

    Args:
        session: Of a client; each stand-in needs one of its own, as each node has.
        node: Its name.
        namespace: First chunk of its keys.
        clock_ahead_s: How far the clock that it reads is ahead of this machine's.
        answers: Whether it answers at all.
        counters: Totals after so many seconds.
        health: Fields of its diagnostics.
        parameters: Name and fields of each parameter.
        second_s: How long its seconds are: short ones let a test see many reports soon.
        about: Fields of its description.
    """

    def __init__(
        self,
        session: zenoh.Session,
        node: str,
        *,
        namespace: str = "vision",
        clock_ahead_s: float = 0.0,
        answers: bool = True,
        counters: Callable[[float], dict[str, int]] = lambda _: {"received": 0, "processed": 0},
        health: Mapping[str, Any] | None = None,
        parameters: Mapping[str, Mapping[str, Any]] | None = None,
        second_s: float = 1.0,
        **about: Any,
    ) -> None:
        self._node = node
        self._ahead_ns = int(clock_ahead_s * 1e9)
        self._begun_s = time.monotonic()
        self._second_s = second_s
        self._counters = counters
        self._health = dict(health or {})
        self._about = about
        self._kept: list[object] = []
        if answers:
            self._answer(session, f"@{namespace}/node/{node}", self._description)
            self._answer(session, f"@{namespace}/diagnostics/{node}", self._diagnostics)
        for name, fields in (parameters or {}).items():
            said = {"node": node, "name": name, "type": "float", "default": None, **fields}
            self._answer(session, f"@{namespace}/param/{node}/{name}", lambda said=said: said)
        self._kept.append(session.liveliness().declare_token(f"@{namespace}/node/{node}"))

    @property
    def _now_ns(self) -> int:
        return time.time_ns() + self._ahead_ns

    def _answer(
        self, session: zenoh.Session, key: str, say: Callable[[], Mapping[str, Any]]
    ) -> None:
        def on_query(query: zenoh.Query) -> None:
            with query:
                query.reply(key, msgpack.packb(say()))

        handler = zenoh.handlers.Callback(on_query, indirect=False)
        self._kept.append(session.declare_queryable(key, handler))

    def _description(self) -> dict[str, Any]:
        return {
            "node": self._node,
            "service": self._node.partition("_")[0],
            "cameras": ["front"],
            "version": "0.1.0",
            "host": "elsewhere",
            "pid": os.getpid(),
            "started_ns": self._now_ns - 60_000_000_000,
            "publishes": [],
            "subscribes": [],
            "stamp_ns": self._now_ns,
            **self._about,
        }

    def _diagnostics(self) -> dict[str, Any]:
        """As a real node's: a new report each of its seconds, the same one in between."""
        seconds = float(int((time.monotonic() - self._begun_s) / self._second_s))
        return {
            "node": self._node,
            "stamp_ns": self._now_ns,
            "level": 0,
            "message": "ok",
            "uptime_s": 60.0 + seconds,
            "counters": self._counters(seconds),
            "rate_hz": 30.0,
            "latency_ms": {"p50": 5.0, "p99": 9.0},
            **self._health,
        }
