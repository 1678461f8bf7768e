"""The outputs of a node: messages and pictures made from frames, and a camera's own frames."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable, Sequence

from zenoh_vision.image.frame import Frame
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.keys import JPEG, RAW_IMAGE
from zenoh_vision.messages import Header, Stamped
from zenoh_vision.node.query_server import QueryServer
from zenoh_vision.topics import COMPRESSED, RAW, Topic, topic_named
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.publisher import Outgoing, StreamPublisher, encoded_picture


class Outputs:
    """The publishers of a node, one for each topic and camera."""

    def __init__(self, node: str, cameras: Sequence[str], topics: Iterable[Topic | str]) -> None:
        self.topics = tuple(topic_named(topic) for topic in topics)
        self._node = node
        self._cameras = tuple(cameras)
        self._publishers: dict[tuple[str, str], StreamPublisher] = {}

    @property
    def keys(self) -> list[str]:
        """The keys that it publishes; empty before ``declare``."""
        return [publisher.key for publisher in self._publishers.values()]

    def declare(self, link: Link, namespace: str, server: QueryServer) -> None:
        """Declare a publisher for each topic and camera."""
        for topic, camera in itertools.product(self.topics, self._cameras):
            self._publishers[topic.name, camera] = StreamPublisher(
                link, topic, topic.key(namespace, camera), server.queue
            )

    def header(self, frame: Frame, encoding: str | None = None) -> Header:
        """Return the header of a result: the frame's identity, this node's name and revision."""
        return frame.header.model_copy(
            update={
                "encoding": encoding,
                "node": self._node,
                "revision": 0 if frame.revision is None else frame.revision.number,
                "done_ns": time.time_ns(),
            }
        )

    def publish(self, topic: Topic | str, message: Stamped) -> None:
        """Publish a message that carries a header."""
        publisher = self._publisher(topic, message.header.camera)
        publisher.offer(lambda: Outgoing.message(message))

    def publish_picture(
        self,
        topic: Topic | str,
        frame: Frame,
        picture: Pixels | Callable[[], Pixels],
        *,
        encoding: str = "bgr8",
        quality: int = 80,
        jpeg: bool | None = None,
        bilevel: bool = False,
    ) -> None:
        """Publish a picture made from a frame, if someone subscribes; keep it for queries.

        Args:
            topic: Says whether the picture is encoded as JPEG or PNG.
            frame: The frame that it was made from.
            picture: Pixels, or a function that makes them. It is called at most once, perhaps
                later and on another thread, so it must not use a borrowed frame (``Frame.keep``).
            encoding: Of the pixels: ``bgr8`` or ``mono8``.
            quality: JPEG quality, 1 to 100.
            jpeg: True or False overrides the topic.
            bilevel: All pixels are 0 or 255: a PNG then has one bit each.
        """
        publisher = self._publisher(topic, frame.header.camera)
        header = self.header(frame, encoding)
        as_jpeg = publisher.topic.encoding == JPEG if jpeg is None else jpeg
        publisher.offer(
            lambda: encoded_picture(
                picture() if callable(picture) else picture,
                header,
                jpeg_quality=quality if as_jpeg else None,
                bilevel=bilevel,
            )
        )

    def publish_frame(self, frame: Frame) -> bool:
        """Publish a camera's own frame, compressed and raw, each if someone subscribes.

        Returns:
            Whether someone subscribes to either.
        """
        attachment = frame.header.to_bytes()
        camera = frame.header.camera
        compressed = self._publisher(COMPRESSED, camera).offer(
            lambda: Outgoing(frame.compressed, frame.mime, attachment)
        )
        raw = self._publisher(RAW, camera).offer(lambda: Outgoing(frame.raw, RAW_IMAGE, attachment))
        return compressed or raw

    def _publisher(self, topic: Topic | str, camera: str) -> StreamPublisher:
        name = topic if isinstance(topic, str) else topic.name
        found = self._publishers.get((name, camera))
        if found is None:
            raise ValueError(
                f"{self._node} does not publish {name} of {camera}; it publishes "
                f"{', '.join(topic.name for topic in self.topics)} "
                f"of {', '.join(self._cameras) or 'no camera'}"
            )
        return found
