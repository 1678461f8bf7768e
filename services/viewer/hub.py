"""One subscription a key while anybody watches it, whatever the number of clients."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from common.errors import VisionError
from common.health import Health
from common.ledger import Ledger
from services.viewer.messages import MessageFeed, Messages
from services.viewer.network import Network
from services.viewer.pictures import Pictures
from services.viewer.rendering import Form
from services.viewer.renditions import Feed
from services.viewer.settings import ViewerSettings

MAX_KEYS = 256
RENDERERS = 2


class TooMany(VisionError):
    """More streams are asked for than the viewer subscribes to."""


class Hub:
    """The streams that are watched now; all of it on the browsers' loop.

    Args:
        network: Where the subscriptions are made.
        health: Of the node.
        ledger: Its counters: a sample is processed when the first client gets it.
        options: The settings in force.
    """

    def __init__(
        self,
        network: Network,
        health: Health,
        ledger: Ledger,
        options: Callable[[], ViewerSettings],
    ) -> None:
        self.network = network
        self.health = health
        self.ledger = ledger
        self.options = options
        self.pool = ThreadPoolExecutor(RENDERERS, thread_name_prefix="render")
        self._pictures: dict[str, Pictures] = {}
        self._messages: dict[str, Messages] = {}

    def watch(self, key: str, form: Form) -> Feed:
        """Begin to get the pictures of a key; ``Feed.close`` ends that.

        Raises:
            TooMany: So many keys are watched already.
        """
        stream = self._pictures.get(key)
        if stream is None:
            self._check()
            stream = self._pictures[key] = Pictures(key, self)
            stream.declare()
        return stream.feed(form)

    def listen(self, key: str, ready: Callable[[], None]) -> MessageFeed:
        """Begin to get the messages of a key; ``MessageFeed.close`` ends that.

        Args:
            key: Full key expression.
            ready: Called when there is one to take.

        Raises:
            TooMany: So many keys are watched already.
        """
        stream = self._messages.get(key)
        if stream is None:
            self._check()
            stream = self._messages[key] = Messages(key, self)
            stream.declare()
        return stream.feed(ready)

    def newest(self, key: str) -> Pictures | None:
        """Return the stream of a key if someone watches it."""
        return self._pictures.get(key)

    def forget(self, stream: Pictures | Messages) -> None:
        """End a stream that nobody watches any more, and its subscription."""
        if isinstance(stream, Pictures):
            self._pictures.pop(stream.key, None)
        else:
            self._messages.pop(stream.key, None)
        stream.end()

    def begin(self) -> None:
        """Subscribe to all that is watched: there is a session now."""
        for pictures in self._pictures.values():
            pictures.declare()
        for messages in self._messages.values():
            messages.declare()

    def listened(self) -> list[str]:
        """Return the keys of the messages that are watched; from any thread."""
        return sorted(self._messages.copy())

    def close(self) -> None:
        """Make no more pictures."""
        self.pool.shutdown(wait=False, cancel_futures=True)

    @property
    def loop(self) -> asyncio.AbstractEventLoop:
        """The browsers' loop."""
        return self.network.loop

    def _check(self) -> None:
        if len(self._pictures) + len(self._messages) >= MAX_KEYS:
            raise TooMany(f"{MAX_KEYS} streams are watched already, which is the most allowed")
