"""What a node sends: messages and pictures made from frames, and a camera's own frames."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable, Sequence

from common import keys
from common.frame import Frame
from common.images import Pixels
from common.keys import Topic
from common.link import Link
from common.messages import Header, Stamped
from common.publishing import Sample, StreamPublisher, picture_sample
from common.serving import QueryServer


class Results:
    """The publishers of a node, one a topic and camera, and what goes out through them.

    Args:
        name: Of the node.
        cameras: Those it serves.
        topics: What it publishes for each, rows of the topic table or their names.
    """

    def __init__(self, name: str, cameras: Sequence[str], topics: Iterable[Topic | str]) -> None:
        self.name = name
        self.cameras = tuple(cameras)
        self._topics = [keys.TOPICS[t] if isinstance(t, str) else t for t in topics]
        self._publishers: dict[tuple[str, str], StreamPublisher] = {}

    @property
    def revision(self) -> int:
        """Number of the revision of its parameters that is in force; 0 without parameters."""
        return 0

    @property
    def published_keys(self) -> list[str]:
        """The keys it publishes, once it is open."""
        return [publisher.key for publisher in self._publishers.values()]

    def _declare_publishers(self, link: Link, namespace: str, server: QueryServer) -> None:
        for topic, camera in itertools.product(self._topics, self.cameras):
            self._publishers[topic.name, camera] = StreamPublisher(
                link, topic, topic.key(namespace, camera), server.ask
            )

    def header(self, frame: Frame, encoding: str | None = None) -> Header:
        """Return the header of something derived from a frame: its identity, our name."""
        return frame.header.model_copy(
            update={
                "encoding": encoding,
                "node": self.name,
                "revision": self.revision,
                "done_ns": time.time_ns(),
            }
        )

    def publish(self, topic: Topic | str, message: Stamped) -> None:
        """Publish a message that carries a header."""
        publisher = self._publisher(topic, message.header.camera)
        encoding = publisher.topic.encoding
        publisher.offer(lambda: Sample(message.to_bytes(), encoding, message.header.to_bytes()))

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
            topic: Its row says whether it goes as JPEG or PNG.
            frame: What it was made from.
            picture: Its pixels, or what makes them: called at most once, maybe later and on
                another thread.
            encoding: What the pixels are: ``bgr8`` or ``mono8``.
            quality: JPEG quality.
            jpeg: True or False overrides the row.
            bilevel: All pixels are 0 or 255: a PNG then has one bit each.
        """
        publisher = self._publisher(topic, frame.header.camera)
        header = self.header(frame, encoding)
        as_jpeg = publisher.topic.encoding == keys.JPEG if jpeg is None else jpeg

        publisher.offer(
            lambda: picture_sample(
                picture() if callable(picture) else picture,
                header,
                jpeg_quality=quality if as_jpeg else None,
                bilevel=bilevel,
            )
        )

    def publish_frame(self, frame: Frame) -> bool:
        """Publish a camera's own frame, compressed and raw, each only if someone subscribes.

        Returns:
            Whether anyone got it.
        """
        attachment = frame.header.to_bytes()
        camera = frame.header.camera
        compressed = self._publisher(keys.IMAGE, camera).offer(
            lambda: Sample(frame.compressed, frame.mime, attachment)
        )
        raw = self._publisher(keys.RAW, camera).offer(
            lambda: Sample(frame.raw, keys.RAW_IMAGE, attachment)
        )
        return compressed or raw

    def _publisher(self, topic: Topic | str, camera: str) -> StreamPublisher:
        name = topic if isinstance(topic, str) else topic.name
        return self._publishers[name, self._camera(camera)]

    def _camera(self, camera: str | None) -> str:
        """Return the node's own camera; of several, the one that is named."""
        if len(self.cameras) == 1:
            return self.cameras[0]
        if camera not in self.cameras:
            raise ValueError(f"{self.name} serves {self.cameras or 'no camera'}, not {camera!r}")
        return camera
