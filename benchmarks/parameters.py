"""Measures the time from setting a parameter to the first frame that was made with it."""

from __future__ import annotations

import random
import threading
import time
from itertools import cycle
from typing import Any

import msgpack
import zenoh

from benchmarks.stream import RATE_HZ, first_frame, percentiles
from benchmarks.system import System
from zenoh_vision.messages import Header, Parameter
from zenoh_vision.transport.session import direct

CASES: dict[str, tuple[str, str, tuple[object, object]]] = {
    "camera quality": ("camera_front/quality", "image/compressed", (60, 80)),
    "camera flip": ("camera_front/flip", "image/compressed", ("both", "none")),
    "camera faults": ("camera_front/faults", "image/compressed", ("lighting@now+5", "")),
    "tracker threshold": ("tracker_front/threshold", "centroid", (100, 127)),
    "edge low": ("edge_front/low", "edges/compressed", (30.0, 40.0)),
}
"""Parameter, the stream whose frames are observed, and two alternating values."""

WAIT_S = 5.0


class FirstOfRevision:
    """When the first frame of each revision came on a key, by the monotonic clock."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self._at_s: dict[int, float] = {}
        self._last_s = 0.0
        self._news = threading.Condition()
        self._subscriber = session.declare_subscriber(key, direct(self._on_sample))

    def _on_sample(self, sample: zenoh.Sample) -> None:
        now_s = time.monotonic()
        assert sample.attachment is not None
        revision = Header.from_bytes(sample.attachment.to_bytes()).revision
        with self._news:
            self._at_s.setdefault(revision, now_s)
            self._last_s = now_s
            self._news.notify_all()

    def wait_for(self, revision: int) -> float:
        """Return when the first frame of a revision came."""
        with self._news:
            if not self._news.wait_for(lambda: revision in self._at_s, WAIT_S):
                raise SystemExit(f"no frame of revision {revision} within {WAIT_S:g} s")
            return self._at_s[revision]

    def next_after(self, at_s: float) -> float:
        """Return when the next frame after a time came."""
        with self._news:
            self._news.wait_for(lambda: self._last_s > at_s, WAIT_S)
            return self._last_s

    def close(self) -> None:
        """Unsubscribe."""
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]


def set_to_frame(seconds: float) -> dict[str, Any]:
    """Set parameters at any time between two frames, about four a second.

    Returns:
        Per case, in times between two frames: p50, p99 and the largest; the time until the node
        has answered, in milliseconds; and as the minimum, in the same run, the time from any
        moment to the next frame of any revision.
    """
    found: dict[str, Any] = {}
    chance = random.Random(1)
    with System() as system:
        system.service("camera", "camera", "--rate", f"{RATE_HZ:g}")
        system.service("tracker", "tracker")
        system.service("edge", "edge")
        first_frame(system)
        session = system.session()
        for case, (parameter, stream, values) in CASES.items():
            first = FirstOfRevision(session, f"vision/front/{stream}")
            time.sleep(1)  # until the stream flows, since now someone wants it
            found[case] = _one_case(session, first, parameter, values, seconds, chance)
            first.close()
        session.close()
    return found


def _one_case(
    session: zenoh.Session,
    first: FirstOfRevision,
    parameter: str,
    values: tuple[object, object],
    seconds: float,
    chance: random.Random,
) -> dict[str, Any]:
    frames, answers_ms, floor = [], [], []
    end_s = time.monotonic() + seconds
    for value in cycle(values):
        if time.monotonic() > end_s:
            break
        time.sleep(chance.uniform(0.05, 0.15))
        any_s = time.monotonic()
        floor.append((first.next_after(any_s) - any_s) * RATE_HZ)
        time.sleep(chance.uniform(0.0, 0.1))
        begun_s = time.monotonic()
        revision = set_parameter(session, parameter, value)
        answers_ms.append((time.monotonic() - begun_s) * 1e3)
        frames.append((first.wait_for(revision) - begun_s) * RATE_HZ)
    return {
        "sets": len(frames),
        "floor_frame_times": percentiles(floor),
        "frame_times": percentiles(frames) | {"max": round(max(frames), 3)},
        "answer_ms": percentiles(answers_ms),
    }


def set_parameter(session: zenoh.Session, parameter: str, value: object) -> int:
    """Set a parameter and return the revision that has it."""
    for reply in session.get(f"@vision/set/{parameter}", payload=msgpack.packb(value)):
        if reply.ok is not None:
            return Parameter.from_bytes(reply.ok.payload.to_bytes()).revision
    raise SystemExit(f"{parameter} could not be set")
