"""Messages made to keep the viewer's event loop busy: each costs some ms, and pages go on."""

from __future__ import annotations

import asyncio
import threading
import time
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zenoh

from tests.support.publishing import KEPT, PlainCamera
from tests.support.viewer.client import Viewer

TRACKS = "vision/front/tracks"
MOST_MS = 50
"""CPU time of the whole viewer for one message. It is less than 10; some took 300 and more."""

REPORT = {
    "node": "camera_front", "stamp_ns": 9, "level": 0, "message": "ok", "uptime_s": 1.0,
    "counters": {}, "rate_hz": 1.0, "latency_ms": {"p50": None, "p99": None},
}  # fmt: skip
DESCRIPTION = {
    "service": "camera", "cameras": ["front"], "version": "0", "host": "h", "pid": 1,
    "started_ns": 1, "publishes": [], "subscribes": [], "stamp_ns": 1,
}  # fmt: skip
TRACKS_BODIES = {
    "200 kB in an unknown field": {"tracks": [], "more": list(range(70_000))},
    "64 kB of wrong tracks": {"tracks": [{}] * 9_000 + [None] * 50_000},
    "64 kB of maps in an unknown field": {"tracks": [], "more": [{}] * 60_000},
}


def cpu_s(viewer: Viewer) -> float:
    """Return the CPU time that a viewer has taken."""
    stat = Path(f"/proc/{viewer.program.process.pid}/stat").read_text()
    user, system = stat.rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / 100


class Healthz:
    """Asks again and again, on a thread, whether the viewer is alive."""

    def __init__(self, viewer: Viewer) -> None:
        self.answers: list[int] = []
        self._viewer = viewer
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Healthz:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._stop.set()
        self._thread.join(40)
        assert self.answers
        assert set(self.answers) == {200}

    def _run(self) -> None:
        while not (self.answers and self._stop.wait(0.1)):
            try:
                self.answers.append(self._viewer.get("/healthz").status)
            except OSError:
                self.answers.append(0)


@pytest.mark.parametrize("name", TRACKS_BODIES)
async def test_tracks_that_are_costly_to_check_are_dropped_soon(
    viewer: Viewer, client: zenoh.Session, name: str
):
    header = PlainCamera(client).header()
    hostile = msgpack.packb({"header": header, **TRACKS_BODIES[name]})
    good = msgpack.packb({"header": header, "tracks": []})
    async with viewer.page() as page:
        await page.ask("watch", key=TRACKS)
        while True:  # until the subscription is there
            put(client, TRACKS, good)
            if (await page.next())["op"] == "message":
                break
        before_s = cpu_s(viewer)
        with Healthz(viewer):
            for _ in range(20):
                put(client, TRACKS, hostile)
                await asyncio.sleep(0.1)
            marked = {"header": header, "tracks": [], "last": True}
            put(client, TRACKS, msgpack.packb(marked))
            while not (await page.text("message", key=TRACKS))["body"].get("last"):
                pass
        assert 1000 * (cpu_s(viewer) - before_s) / 20 < MOST_MS


@pytest.mark.parametrize("counters", [25_000, 2_500])
async def test_reports_with_many_wrong_counters_are_dropped_soon(
    viewer: Viewer, client: zenoh.Session, counters: int
):
    key = "@vision/diagnostics/camera_front"
    wrong = {f"c{number}": -1 for number in range(counters)}
    hostile = msgpack.packb({**REPORT, "counters": wrong})
    async with viewer.page() as page:
        with client.liveliness().declare_token("@vision/node/camera_front"), Healthz(viewer):
            while not any(
                each["node"] == "camera_front" for each in (await page.text("nodes"))["nodes"]
            ):
                pass
            before_s = cpu_s(viewer)
            for _ in range(19):
                put(client, key, hostile)
            put(client, key, msgpack.packb({**REPORT, "message": "the last"}))
            found = await page.text("health", node="camera_front")
            assert found["diagnostics"]["message"] == "the last"
            assert 1000 * (cpu_s(viewer) - before_s) / 19 < MOST_MS


@pytest.mark.parametrize(
    "publishes",
    [[f"vision/front/x{number}" for number in range(25_000)], [1] * 100_000],
    ids=["many", "wrong"],
)
async def test_descriptions_of_many_keys_are_dropped_soon(
    viewer: Viewer, client: zenoh.Session, publishes: list[Any]
):
    answered = []

    def reply(name: str, query: zenoh.Query) -> None:
        found = {**DESCRIPTION, "node": name, "publishes": publishes}
        query.reply(f"@vision/node/{name}", msgpack.packb(found))
        answered.append(time.monotonic())

    async with viewer.page() as page:
        await page.text("nodes")
        before_s = cpu_s(viewer)
        with ExitStack() as stack, Healthz(viewer):
            for number in range(20):
                name = f"camera_{number}"
                key = f"@vision/node/{name}"
                stack.enter_context(client.declare_queryable(key, partial(reply, name)))
                stack.enter_context(client.liveliness().declare_token(key))
            while len(answered) < 40:  # they are asked again
                await page.text("tick")
            await page.text("tick")
        assert 1000 * (cpu_s(viewer) - before_s) / len(answered) < MOST_MS


def put(session: zenoh.Session, key: str, payload: bytes) -> None:
    session.put(key, payload, congestion_control=KEPT)
