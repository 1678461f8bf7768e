"""The other end of the page's WebSocket, which says what a test wants."""

from __future__ import annotations

import json
import re
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tests.support.viewer.browser import Tab, tab

NOW_NS = time.time_ns()


class PageServer:
    """The other end of ``/live``, which says what the test wants, and nothing else.

    Args:
        page: Playwright's, before it is opened.
        streams: What is said first of the streams, see ``stream``.
    """

    def __init__(self, page: Any, *streams: dict[str, Any]) -> None:
        self.asked: list[dict[str, Any]] = []
        self._streams = streams
        self._socket: Any = None
        page.route_web_socket(re.compile("/live"), self._serve)

    def _serve(self, socket: Any) -> None:
        socket.on_message(lambda text: self.asked.append(json.loads(text)))
        self._socket = socket
        self.greet(NOW_NS)
        self.tell("streams", streams=self._streams)

    def greet(self, now_ns: int) -> None:
        """Say what time it is here."""
        facts = {"version": "0", "namespace": "vision", "server": "viewer"}
        self.tell("hello", **facts, now_ns=str(now_ns))

    def tell(self, op: str, **fields: object) -> None:
        """Send a text."""
        self._socket.send(json.dumps({"op": op, **fields}))

    def show(self, key: str, payload: bytes, header: dict[str, Any], **about: object) -> None:
        """Send a picture, a PNG; ``about`` is added to what is said of it."""
        size = {"width": header["width"], "height": header["height"]}
        numbers = {"bytes": len(payload), "age_ms": 1.0, "skipped": 0, "lost": 0}
        fields = {"key": key, "mime": "image/png", "header": header, **size, **numbers, **about}
        head = json.dumps(fields).encode()
        self._socket.send(struct.pack("<I", len(head)) + head + payload)

    def watches(self, key: str) -> list[dict[str, Any]]:
        """Return what the page asked of a stream, without its key: the newest is last."""
        found = [one for one in self.asked if one["op"] == "watch" and one["key"] == key]
        return [{name: one[name] for name in one if name not in ("op", "key")} for one in found]


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
