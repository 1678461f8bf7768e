"""Publish one key: made only when wanted, put with the right urgency, kept for queries."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

import zenoh

from common import images
from common.images import Pixels
from common.keys import JPEG, PNG, Topic
from common.link import Link
from common.messages import Header
from common.session import direct


@dataclass(frozen=True, slots=True)
class Sample:
    """What goes on the wire: payload, its Zenoh encoding, and the header's bytes."""

    payload: bytes
    encoding: str
    attachment: bytes | None


def picture_sample(
    pixels: Pixels, header: Header, *, jpeg_quality: int | None, bilevel: bool
) -> Sample:
    """Return a picture as it goes on the wire.

    Args:
        pixels: As ``header.encoding`` says, 8 bits.
        header: Its identity.
        jpeg_quality: As JPEG of this quality; None for PNG.
        bilevel: All pixels are 0 or 255: a PNG then has one bit each.
    """
    attachment = header.to_bytes()
    if jpeg_quality is None:
        return Sample(images.encode_png(pixels, bilevel=bilevel), PNG, attachment)
    jpeg = images.encode_jpeg(pixels, header.encoding or "bgr8", jpeg_quality)
    return Sample(jpeg, JPEG, attachment)


class Once:
    """A sample that is made when first asked for, and only once, by whichever thread asks."""

    def __init__(self, make: Callable[[], Sample]) -> None:
        self._make: Callable[[], Sample] | None = make
        self._sample: Sample | None = None
        self._lock = threading.Lock()

    def __call__(self) -> Sample:
        """Return the sample, making it if nobody has yet."""
        with self._lock:
            if self._sample is None:
                assert self._make is not None
                self._sample = self._make()
                self._make = None  # let go of what it was made from
            return self._sample


FRAME_DELIVERY = (zenoh.CongestionControl.BLOCK_FIRST, zenoh.Priority.DATA)
MESSAGE_DELIVERY = (zenoh.CongestionControl.BLOCK, zenoh.Priority.INTERACTIVE_HIGH)


class StreamPublisher:
    """Publishes one key and remembers its newest sample.

    Args:
        link: To the router.
        topic: Row of the topic table.
        key: Full key expression.
        ask: Called on Zenoh's thread with each query on the key; must return at once.
    """

    def __init__(
        self,
        link: Link,
        topic: Topic,
        key: str,
        ask: Callable[[zenoh.Query, Callable[[zenoh.Query], None]], None],
    ) -> None:
        self.topic = topic
        self.key = key
        congestion_control, priority = (
            FRAME_DELIVERY if topic.delivery == "frame" else MESSAGE_DELIVERY
        )
        self._newest: Once | None = None
        self._publisher = link.declare(
            lambda session: session.declare_publisher(
                key,
                encoding=topic.encoding,
                congestion_control=congestion_control,
                priority=priority,
            )
        )
        self._queryable = link.declare(
            lambda session: session.declare_queryable(
                key, direct(lambda query: ask(query, self.answer)), complete=True
            )
        )

    @property
    def wanted(self) -> bool:
        """Whether someone subscribes to the key."""
        return bool(self._publisher.now.matching_status.matching)  # type: ignore[attr-defined]

    def offer(self, make: Callable[[], Sample]) -> bool:
        """Make ``make()`` the key's newest sample and put it if it is wanted.

        Returns:
            Whether it was put. A topic that is not lazy is always put.
        """
        once = Once(make)
        self._newest = once
        if self.topic.lazy and not self.wanted:
            return False
        sample = once()
        self._publisher.now.put(
            sample.payload, encoding=sample.encoding, attachment=sample.attachment
        )
        return True

    def answer(self, query: zenoh.Query) -> None:
        """Reply with the newest sample; no reply if there is none yet."""
        newest = self._newest
        if newest is None:
            return
        sample = newest()
        query.reply(
            self.key, sample.payload, encoding=sample.encoding, attachment=sample.attachment
        )
