"""A client outside the containers that keeps every header it saw, and judges them."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import msgpack
import zenoh

from tests.support.containers.stack import HANDSHAKE_MS, OURS
from tests.support.listening import Listener, Message, drops, open_client
from tests.support.waiting import wait_until

IMAGE = "vision/front/image/compressed"
CENTROID = "vision/front/centroid"
EDGES = "vision/front/edges/compressed"
STREAMS = (IMAGE, CENTROID, EDGES)
RATE_HZ = 30.0
OLD_S = 0.4


@dataclass(frozen=True)
class Seen:
    """One arrival; without its payload, so that hours of them can be kept."""

    epoch: int
    seq: int
    stamp_ns: int
    at_s: float
    at_ns: int

    @property
    def age_s(self) -> float:
        """From capture to arrival here; both clocks are this machine's."""
        return (self.at_ns - self.stamp_ns) / 1e9


@dataclass(frozen=True)
class Gap:
    """Sequence numbers that did not arrive, between two that did."""

    before: Seen
    after: Seen

    @property
    def missing(self) -> int:
        return self.after.seq - self.before.seq - 1


class Stream(Listener):
    """Keeps the headers of one key that nodes of ours sent."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self.seen: list[Seen] = []
        camera = key.split("/")[1]
        self._nodes = {f"{service}_{camera}" for service in OURS}
        super().__init__(session, key)

    def _keep(self, sample: zenoh.Sample) -> None:
        at_s, at_ns = time.monotonic(), time.time_ns()
        try:
            header = msgpack.unpackb(sample.attachment.to_bytes())  # type: ignore[union-attr]
            if header["node"] not in self._nodes:
                return  # a stranger's, in the tests that have one
            one = Seen(header["epoch"], header["seq"], header["stamp_ns"], at_s, at_ns)
        except Exception:
            return
        self.seen.append(one)

    def after(self, at_s: float) -> list[Seen]:
        return [one for one in list(self.seen) if one.at_s > at_s]

    def captured_after(self, at_s: float) -> list[Seen]:
        """What was captured after a monotonic time."""
        at_ns = time.time_ns() - (time.monotonic() - at_s) * 1e9
        return [one for one in list(self.seen) if one.stamp_ns > at_ns]

    def wait_for(self, count: int, deadline_s: float = 30.0, after_s: float = 0.0) -> list[Any]:
        """Wait for so many that were captured after a time."""

        def enough() -> list[Seen]:
            found = self.captured_after(after_s)
            return found if len(found) >= count else []

        return wait_until(enough, deadline_s, lambda: f"{len(self.captured_after(after_s))} seen")


class Witness:
    """Subscribes to the streams of one camera and to the health of all nodes.

    Args:
        endpoint: Of the router.
        keys: Of the streams.
    """

    def __init__(self, endpoint: str, keys: Iterable[str] = STREAMS) -> None:
        self.session = wait_until(lambda: opened(endpoint), 60)
        self.streams = {key: Stream(self.session, key) for key in keys}
        self.health = Listener(self.session, "@vision/diagnostics/*")

    def __enter__(self) -> Witness:
        return self

    def __exit__(self, *_: object) -> None:
        self.session.close()

    def __getitem__(self, key: str) -> Stream:
        return self.streams[key]

    def flows(self, count: int = 10, after_s: float = 0.0, deadline_s: float = 60.0) -> None:
        """Wait until so many frames, captured after a time, have come on every stream."""
        for stream in self.streams.values():
            stream.wait_for(count, deadline_s, after_s)

    def back_s(self, since_s: float, after_s: float | None = None) -> float:
        """Return when the last of the streams was back, in seconds after ``since_s``.

        Args:
            since_s: When it became possible.
            after_s: Only frames captured after this count.
        """
        firsts = []
        for key, stream in self.streams.items():
            found = stream.wait_for(1, 30, since_s if after_s is None else after_s)
            assert found, key
            firsts.append(found[0].at_s)
        return max(firsts) - since_s

    def reports(self, node: str) -> list[dict[str, Any]]:
        """Return all that a node has said of its health."""
        key = f"@vision/diagnostics/{node}"
        return [message.body for message in self.health.messages if message.key == key]

    def counted_drops(self, key: str, since_s: float) -> int:
        """Return how many frames the nodes behind a stream say they dropped since a time.

        Between the last report before that time, or the node's start if none was seen, and the
        next report from now on.
        """
        found = 0
        for service in {IMAGE: ("camera",), CENTROID: ("camera", "tracker")}.get(
            key, ("camera", "edge")
        ):
            node = f"{service}_front"
            before = [
                message.body["counters"]
                for message in self.health.messages
                if message.key == f"@vision/diagnostics/{node}" and message.at_s <= since_s
            ]
            found += drops(self.counters(node)) - (drops(before[-1]) if before else 0)
        return found

    def counters(self, node: str, after_s: float | None = None) -> dict[str, int]:
        """Return the counters of a node's first report after a time; by default from now on."""
        asked_s = time.monotonic() if after_s is None else after_s
        key = f"@vision/diagnostics/{node}"

        def reports() -> list[Message]:
            return [m for m in self.health.since(asked_s) if m.key == key]

        return wait_until(reports, 10, lambda: f"no health of {node}")[0].body["counters"]


def opened(endpoint: str) -> zenoh.Session | None:
    try:
        return open_client(endpoint, HANDSHAKE_MS)
    except zenoh.ZError:
        return None


def assert_whole(seen: list[Seen], oldest_s: float = OLD_S) -> None:
    """No frame twice, none after a later one of its epoch, none of an earlier epoch, none old.

    Args:
        seen: In order of arrival.
        oldest_s: The age that none may have.
    """
    identities = [(one.epoch, one.seq) for one in seen]
    wrong = [f"{a} then {b}" for a, b in pairwise(identities) if b <= a]
    assert not wrong, wrong[:5]
    worst = max((one.age_s for one in seen), default=0.0)
    assert worst <= oldest_s, f"a frame was {worst:.3f} s old"


def gaps(seen: list[Seen]) -> list[Gap]:
    """Return where numbers are missing within an epoch."""
    found = [Gap(a, b) for a, b in pairwise(seen) if a.epoch == b.epoch]
    return [gap for gap in found if gap.missing]


def split(
    seen: list[Seen], outages: list[tuple[float, float]], slack_s: float = 0.3
) -> tuple[int, int]:
    """Count the missing numbers: those that the outages explain, and the others.

    Args:
        seen: In order of arrival.
        outages: Begin and end of each, monotonic seconds.
        slack_s: How far around an outage its effect reaches.
    """
    counts = [0, 0]
    for gap in gaps(seen):
        inside = any(
            gap.before.at_s > begin - slack_s and gap.after.at_s < end + slack_s
            for begin, end in outages
        )
        counts[not inside] += gap.missing
    return counts[0], counts[1]
