"""What a plain Zenoh program sees: sessions, subscriptions and queries without code of ours."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import msgpack
import zenoh

from tests.support.waiting import DEADLINE_S, wait_until


@dataclass(frozen=True)
class Message:
    """One sample as it came off the wire."""

    key: str
    payload: bytes
    encoding: str
    attachment: bytes | None
    deleted: bool = False
    at_s: float = field(default_factory=time.monotonic)
    at_ns: int = field(default_factory=time.time_ns)

    @property
    def header(self) -> dict[str, Any]:
        assert self.attachment is not None, f"{self.key}: no attachment"
        header: dict[str, Any] = msgpack.unpackb(self.attachment)
        return header

    @property
    def body(self) -> dict[str, Any]:
        body: dict[str, Any] = msgpack.unpackb(self.payload)
        return body

    @property
    def age_s(self) -> float:
        """From its frame's capture to its arrival here."""
        return (self.at_ns - self.header["stamp_ns"]) / 1e9


class Listener:
    """Keeps all that comes on a key expression; ends with its session."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self._key = key
        self._messages: list[Message] = []
        self._lock = threading.Lock()
        handler = zenoh.handlers.Callback(self._keep, indirect=False)
        self._subscriber = session.declare_subscriber(key, handler)

    def _keep(self, sample: zenoh.Sample) -> None:
        message = message_of(sample)
        with self._lock:
            self._messages.append(message)

    @property
    def messages(self) -> list[Message]:
        with self._lock:
            return list(self._messages)

    def since(self, at_s: float) -> list[Message]:
        return [message for message in self.messages if message.at_s > at_s]

    def wait_for(
        self, count: int, deadline_s: float = DEADLINE_S, after_s: float = 0.0
    ) -> list[Message]:
        """Return the messages after a time as soon as there are so many."""

        def enough() -> list[Message]:
            found = self.since(after_s)
            return found if len(found) >= count else []

        return wait_until(
            enough, deadline_s, lambda: f"{len(self.since(after_s))} of {count} on {self._key}"
        )

    def close(self) -> None:
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]


def message_of(sample: zenoh.Sample) -> Message:
    return Message(
        key=str(sample.key_expr),
        payload=sample.payload.to_bytes(),
        encoding=str(sample.encoding),
        attachment=None if sample.attachment is None else sample.attachment.to_bytes(),
        deleted=sample.kind == zenoh.SampleKind.DELETE,
    )


def open_client(endpoint: str, handshake_ms: int = 3_000) -> zenoh.Session:
    """Open a session as any program would, with quick retries.

    Args:
        endpoint: Of a router.
        handshake_ms: An attempt to connect is given up after so long. A router on a busy machine
            may need seconds for its part; Docker's proxy, whose router is away, never answers.
    """
    config = zenoh.Config()
    for key, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": 20_000,  # a busy machine may need more than one attempt
        "connect/retry": {
            "period_init_ms": 20,
            "period_max_ms": 50,
            "period_increase_factor": 2,
        },
        "transport/unicast/open_timeout": handshake_ms,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def ask(session: zenoh.Session, key: str, timeout_s: float = 5.0) -> list[Message]:
    """Return all replies to a query."""
    replies = list(session.get(key, timeout=timeout_s))
    assert all(reply.ok for reply in replies), [
        reply.err.payload.to_string() for reply in replies if reply.err
    ]
    return [message_of(reply.ok) for reply in replies]


def newest(session: zenoh.Session, key: str, deadline_s: float = DEADLINE_S) -> Message:
    """Return the newest sample of a stream, as soon as it has one."""
    return wait_until(lambda: ask(session, key), deadline_s, lambda: f"no reply on {key}")[0]


def report_after(session: zenoh.Session, node: str, at_ns: int) -> Message:
    """Return a node's newest report, as soon as there is one that was made after a time."""

    def made() -> Message | None:
        report = newest(session, f"@vision/diagnostics/{node}")
        return report if report.body["stamp_ns"] > at_ns else None

    return wait_until(made)


def wait_for_nodes(session: zenoh.Session, *nodes: str, deadline_s: float = DEADLINE_S) -> None:
    """Wait until all these nodes have shown their tokens."""
    wanted = {f"@vision/node/{node}" for node in nodes}
    wait_until(
        lambda: wanted <= living_nodes(session), deadline_s, lambda: f"{living_nodes(session)}"
    )


def living_nodes(session: zenoh.Session) -> set[str]:
    """Return the keys of all liveliness tokens of nodes."""
    replies = session.liveliness().get("@vision/node/*", timeout=2.0)
    return {str(reply.ok.key_expr) for reply in replies if reply.ok}


def balance(counters: dict[str, int]) -> int:
    """Return what came in minus what was done, dropped and is pending: 0 if it balances."""
    arrived = counters["captured"] if "captured" in counters else counters["received"]
    done = counters["published"] if "captured" in counters else counters["processed"]
    return arrived - done - counters["pending"] - drops(counters)


def drops(counters: dict[str, int]) -> int:
    """Return all drops together."""
    return sum(count for name, count in counters.items() if name.startswith("dropped."))


def wait_until_listed(session: zenoh.Session, *keys: str, kind: str = "publisher") -> None:
    """Wait until the router lists publishers, or else subscribers, of these keys."""
    wait_until(lambda: all(list(session.get(f"@/*/router/{kind}/{key}")) for key in keys))


def known_queryable(
    session: zenoh.Session,
    key: str,
    answer: Callable[[zenoh.Query], object],
    *,
    complete: bool = False,
) -> zenoh.Queryable[None]:
    """Declare a queryable, and wait until the router knows it: before that it gets no queries.

    Zenoh sends declarations first, and the router handles what a session sends in order.
    """
    queryable = session.declare_queryable(key, answer, complete=complete)
    wait_until(lambda: list(session.get("@/*/router")))
    return queryable
