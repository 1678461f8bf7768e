"""The other end of the page's WebSocket, which says what a test wants."""

from __future__ import annotations

import json
import re
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np

from tests.support.viewer.browser import Tab, tab
from tests.support.waiting import wait_until

NOW_NS = time.time_ns()

# A server says the time every 2 s, else the page connects again after 6: this one speaks only when
# the test does, and what it told a connection that the page has given up would be lost.
KEEP_ALIVE = """
    const Socket = window.WebSocket;
    window.WebSocket = class extends Socket {
        constructor(...address) {
            super(...address);
            setInterval(() => {
                if (window.silent || this.readyState !== Socket.OPEN) return;
                this.dispatchEvent(new MessageEvent("message", { data: '{"op": "alive"}' }));
            }, 500);
        }
    };
"""


class PageServer:
    """The other end of ``/live``, which says what the test wants, and nothing else.

    Args:
        page: Playwright's, before it is opened.
        streams: What is said first of the streams, see ``stream``.

    Attributes:
        asked: What the page sent, oldest first.
        scope: What the page may do, by what it is told when it connects.
    """

    def __init__(self, page: Any, *streams: dict[str, Any]) -> None:
        self.asked: list[dict[str, Any]] = []
        self.scope = "control"
        self._answered = 0
        self._page = page
        self._streams = streams
        self._socket: Any = None
        page.route_web_socket(re.compile("/live"), self._serve)
        page.add_init_script(KEEP_ALIVE)

    def _serve(self, socket: Any) -> None:
        socket.on_message(lambda text: self.asked.append(json.loads(text)))
        self._socket = socket
        facts = {"version": "0", "namespace": "vision", "server": "viewer", "scope": self.scope}
        self.tell("hello", **facts, now_ns=str(NOW_NS))
        self.tell("streams", streams=self._streams)

    def end(self) -> None:
        """Close the connection."""
        self._socket.close()

    def tell(self, op: str, **fields: object) -> None:
        self._socket.send(json.dumps({"op": op, **fields}))

    def answer(self, **reply: object) -> dict[str, Any]:
        """Return the next request about parameters, and answer it: it succeeds, unless ``ok``."""

        def requests() -> list[dict[str, Any]]:
            self.hear()
            return [one for one in self.asked if "id" in one][self._answered :]

        asked = wait_until(requests, explain=lambda: str(self.asked[-20:]))[0]
        self._answered += 1
        self.tell("reply", id=asked["id"], **{"ok": True, **reply})
        return asked

    def hear(self) -> bool:
        """Let what the page sent arrive; true."""
        return bool(self._page.evaluate("true"))

    def show(self, key: str, payload: bytes, header: dict[str, Any], **about: object) -> None:
        """Send a picture, a PNG; ``about`` is added to what is said of it."""
        size = {"width": header["width"], "height": header["height"]}
        numbers = {"bytes": len(payload), "age_ms": 1.0, "skipped": 0, "lost": 0}
        fields = {"key": key, "mime": "image/png", "header": header, **size, **numbers, **about}
        head = json.dumps(fields).encode()
        self._socket.send(struct.pack("<I", len(head)) + head + payload)

    def show_grey(self, key: str, seq: int, level: int, **fields: object) -> None:
        """Send a frame of one grey value."""
        facts = header(seq, key, **fields)
        self.show(key, png(np.full((facts["height"], facts["width"]), level, np.uint8)), facts)

    def wait_for(self, key: str, watched: bool = True) -> None:
        """Wait until the page watches a stream, or no longer does."""

        def is_so() -> bool:
            self.hear()
            found = [one["op"] for one in self.asked if one.get("key") == key]
            last = [op for op in found if op != "shown"][-1:]
            return (last == ["watch"]) == watched

        wait_until(is_so, explain=lambda: f"{key}: {self.asked[-20:]}")

    def watches(self, key: str) -> list[dict[str, Any]]:
        """Return what the page asked of a stream, without its key: the newest is last."""
        found = [one for one in self.asked if one["op"] == "watch" and one["key"] == key]
        return [{name: one[name] for name in one if name not in ("op", "key")} for one in found]


def header(seq: int, key: str, **fields: object) -> dict[str, Any]:
    """Return the header of a frame of 64x48 pixels."""
    about = {"camera": key.split("/")[1], "epoch": "1", "seq": seq, "stamp_ns": str(NOW_NS)}
    return about | {"width": 64, "height": 48, "encoding": "mono8", "node": "x"} | fields


def png(pixels: Any) -> bytes:
    return cv2.imencode(".png", pixels)[1].tobytes()


def stream(key: str, schema: str = "") -> dict[str, Any]:
    """Return what is said of a stream: of messages if it has a schema, else of pictures."""
    _, camera, topic = key.split("/", 2)
    kind = "message" if schema else "picture"
    about = {"key": key, "kind": kind, "camera": camera, "topic": topic, "type": schema}
    return about | {"node": "a_node", "live": True, "since_ns": None}


@contextmanager
def served_page(
    browser: Any, address: str, *streams: dict[str, Any], **context: Any
) -> Iterator[tuple[Tab, PageServer]]:
    """Yield a tab, not opened yet, and who talks to it; its console must not complain."""
    with tab(browser, address, **context) as found:
        yield found, PageServer(found.page, *streams)
        assert not found.complaints, found.complaints
