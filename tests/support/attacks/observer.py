"""Sees whether good frames come through each service, by their own headers."""

from __future__ import annotations

import asyncio
import http.client
import threading
import time
import urllib.request
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress

import aiohttp
import cv2
import numpy as np

from tests.support.attacks.table import NODES, UNPUBLISHED_KEY, Attack, deep
from tests.support.containers.witness import CENTROID, EDGES, IMAGE, STREAMS, Seen, Witness
from tests.support.listening import balance, report_after
from tests.support.viewer.client import Page, parts
from tests.support.waiting import DEADLINE_S, wait_until
from zenoh_vision.messages import Diagnostics
from zenoh_vision.stream.epoch_gate import SILENCE_NS

TRACKS = "vision/front/tracks"
BACK_S = 2.0
SLOWEST_BACK_S = 3.0

OF_NODE = {"camera_front": IMAGE, "tracker_front": CENTROID, "edge_front": EDGES}


def _process(picture: np.ndarray) -> None:
    """Do the work of a node on a picture."""
    grey = cv2.imdecode(picture, cv2.IMREAD_GRAYSCALE)
    edges = cv2.Canny(cv2.GaussianBlur(grey, (0, 0), 1.4), 50, 150)
    cv2.imencode(".png", edges)


def _most_back_s() -> float:
    """Return how long costly pictures may keep good ones away: 2 s, on a slow machine up to 3 s.

    After the silence that the rule asks for, a node may still be at work on the costliest picture
    and on the one that waited behind it, while others work on the same: the edge detector in one
    thread, the viewer in two, for its stream and for a snapshot. Measured in three threads of this
    process, beside what the machine is busy with, so to be called before an attack.
    """
    picture = np.frombuffer(deep(4, 2304, 4096), np.uint8)
    begun_s = time.perf_counter()
    with ThreadPoolExecutor(3) as nodes:
        list(nodes.map(_process, [picture] * 3))
    needed_s = SILENCE_NS / 1e9 + 2 * (time.perf_counter() - begun_s)
    return min(max(BACK_S, needed_s), SLOWEST_BACK_S)


class Observer:
    """Watches a system from outside: its streams, its health, pages and snapshots of its viewer.

    Args:
        endpoint: Of the router.
        port: Of the viewer.
        token: Of the viewer.
    """

    def __init__(self, endpoint: str, port: int, token: str = "") -> None:
        self._port, self._token = port, token
        self._shown: list[Seen] = []
        self._ended = threading.Event()
        self._closing = ExitStack()
        self._witness = self._closing.enter_context(Witness(endpoint, STREAMS))
        self.session = self._witness.session
        for run in (self._show, self._ask, lambda: asyncio.run(self._watch())):
            thread = threading.Thread(target=self._again, args=(run,), daemon=True)
            thread.start()
            self._closing.callback(thread.join, DEADLINE_S)
        self._closing.callback(self._ended.set)

    def close(self) -> None:
        self._closing.close()

    def back_s(self, since_ns: int) -> dict[str, float]:
        """Return for each node how long after a time its first good frame came.

        A frame is good if the camera sent it, captured after that time: its picture, or what was
        made of it, has come.
        """
        found: dict[str, float] = {}

        def first(node: str) -> Seen | None:
            true = {(one.epoch, one.seq) for one in self._witness[IMAGE].seen}
            key = OF_NODE.get(node)
            seen = self._shown if key is None else self._witness[key].seen
            later = (one for one in list(seen) if one.stamp_ns > since_ns)
            return next((one for one in later if (one.epoch, one.seq) in true), None)

        for node in NODES:
            one = wait_until(lambda node=node: first(node), DEADLINE_S, lambda n=node: n)
            found[node] = (one.at_ns - since_ns) / 1e9
        return found

    def most_back_s(self, attack: Attack) -> float:
        """Return how long after an attack, which has not begun, good frames may be away."""
        return _most_back_s() if attack.is_costly else BACK_S

    def health(self) -> dict[str, Diagnostics]:
        """Return the next report of each node itself; it is valid, and its counters balance."""
        asked_ns, found = time.time_ns(), {}
        for node in NODES:
            found[node] = Diagnostics.from_bytes(report_after(self.session, node, asked_ns).payload)
            assert balance(found[node].counters) == 0, found[node]
        return found

    # What the viewer's clients do

    def _again(self, run: Callable[[], None]) -> None:
        """Connect once more whenever the viewer has ended."""
        while not self._ended.is_set():
            with suppress(Exception):  # it ends in the middle of anything
                run()
            self._ended.wait(0.05)

    def _get(self, path: str, timeout_s: float) -> http.client.HTTPResponse:
        url = f"http://127.0.0.1:{self._port}{path}&token={self._token}"
        return urllib.request.urlopen(url, timeout=timeout_s)

    def _show(self) -> None:
        """Show small pictures, so that the viewer decodes each."""
        with self._get("/stream?topic=/front/image/compressed&width=160", 2) as answer:
            for part in parts(answer):
                seconds, nanoseconds = part.headers["x-timestamp"].split(".")
                stamp_ns = int(seconds) * 10**9 + int(nanoseconds)
                epoch, now_ns = int(part.headers["x-epoch"]), time.time_ns()
                self._shown.append(Seen(epoch, part.seq, stamp_ns, time.monotonic(), now_ns))
                if self._ended.is_set():
                    return

    def _ask(self) -> None:
        """Ask for a snapshot that no open stream has, so that the viewer has to query for it."""
        topic = UNPUBLISHED_KEY.removeprefix("vision")
        with self._get(f"/snapshot?topic={topic}", 5) as answer:
            answer.read()

    async def _watch(self) -> None:
        """Connect as a page that watches messages, receives all of them, and asks for snapshots."""
        url = f"http://127.0.0.1:{self._port}"
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{url}/live?token={self._token}", max_msg_size=0) as socket,
        ):
            page, asked_s = Page(socket), 0.0
            for key in (TRACKS, CENTROID):
                await page.ask("watch", key=key)
            while not self._ended.is_set():
                message = await asyncio.wait_for(socket.receive(), 5)
                if message.type != aiohttp.WSMsgType.TEXT:
                    return
                if time.monotonic() - asked_s > 0.5:
                    asked_s = time.monotonic()
                    path = f"{url}/snapshot?topic=/front/image/compressed&token={self._token}"
                    async with session.get(path) as answer:
                        await answer.read()
