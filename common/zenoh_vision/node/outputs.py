"""The outputs of a node: messages and pictures made from frames, and a camera's own frames."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from zenoh_vision.errors import PayloadError
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.keys import JPEG, RAW_IMAGE
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import Header, Stamped
from zenoh_vision.node.query_server import QueryServer
from zenoh_vision.node.shm_offer import SharedMemoryOffer, may_offer
from zenoh_vision.topics import COMPRESSED, RAW, Topic, topic_named
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.publisher import MayReply, Outgoing, StreamPublisher, encoded_picture

Publishes = Sequence[Topic | str] | Mapping[str, Sequence[Topic | str]]
"""The topics of each camera of a node, or those of all its cameras; a topic, or its name."""


@dataclass(frozen=True, slots=True)
class FrameOutputs:
    """The outputs of one camera's own frames; None for what the node does not publish."""

    compressed: StreamPublisher | None
    raw: StreamPublisher | None
    offer: SharedMemoryOffer | None


class Outputs:
    """The publishers of a node, one for each topic and camera that it publishes.

    Raises:
        ValueError: The table has no topic of a name, or the node does not serve a camera.
    """

    def __init__(self, node: str, cameras: Sequence[str], publishes: Publishes) -> None:
        by_camera = (
            publishes if isinstance(publishes, Mapping) else dict.fromkeys(cameras, publishes)
        )
        for camera in by_camera:
            if camera not in cameras:
                raise ValueError(f"{node} publishes of {camera!r}, but serves {tuple(cameras)}")
        self._topics = {
            camera: tuple(map(topic_named, topics)) for camera, topics in by_camera.items()
        }
        # A sequence of topics is known even while there is no camera yet.
        named = () if isinstance(publishes, Mapping) else map(topic_named, publishes)
        self.topics = tuple(dict.fromkeys(itertools.chain(named, *self._topics.values())))
        self._node = node
        self._cameras = tuple(cameras)
        self._publishers: dict[tuple[str, str], StreamPublisher] = {}
        self._new_publisher: Callable[[Topic, str], StreamPublisher] | None = None
        self._new_offer: Callable[[str], SharedMemoryOffer] | None = None
        self._frames: dict[str, FrameOutputs] = {}

    @property
    def keys(self) -> list[str]:
        """The keys that it publishes; empty before ``declare``."""
        return [publisher.key for publisher in self._publishers.values()]

    def declare(self, link: Link, namespace: str, server: QueryServer) -> None:
        """Declare a publisher for each topic and camera."""

        def publisher(topic: Topic, camera: str) -> StreamPublisher:
            return StreamPublisher(link, topic, topic.key(namespace, camera), server.queue)

        self._new_publisher = publisher
        if may_offer():
            self._new_offer = lambda camera: SharedMemoryOffer(link, namespace, camera)
        for camera, topics in self._topics.items():
            self._declare(camera, topics)

    def add_camera(self, camera: str, topics: Sequence[Topic | str]) -> None:
        """Declare the topics of one more camera; after ``declare``.

        Raises:
            ValueError: The table has no topic of a name.
        """
        added = tuple(map(topic_named, topics))
        self._topics = {**self._topics, camera: added}
        self._cameras = (*self._cameras, camera)
        self._declare(camera, added)

    def _declare(self, camera: str, topics: Sequence[Topic]) -> None:
        assert self._new_publisher is not None
        new = {
            (topic.name, camera): self._new_publisher(topic, camera)
            for topic in topics
            if not topic.by_query
        }
        self._publishers = {**self._publishers, **new}  # other threads may iterate over the old one
        compressed, raw = new.get((COMPRESSED.name, camera)), new.get((RAW.name, camera))
        if compressed is not None or raw is not None:
            offer = None if self._new_offer is None else self._new_offer(camera)
            self._frames = {**self._frames, camera: FrameOutputs(compressed, raw, offer)}

    @property
    def shared_memory_failure(self) -> str:
        """Why frames cannot be offered in shared memory now; empty if they can, or never were."""
        return "; ".join(offer.failure for offer in self._offers() if offer.failure)

    def close(self) -> None:
        """Withdraw the offers of shared memory; the end of the session does the rest."""
        for offer in self._offers():
            offer.close()

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

    def publish(
        self,
        topic: Topic | str,
        message: Message | Callable[[], Message],
        *,
        camera: str | None = None,
    ) -> None:
        """Publish a message.

        Args:
            topic: A topic that the node publishes.
            message: The message, published for the camera in its header, if it has one; or a
                function that makes it. The function is called at most once, perhaps later and on
                another thread, and for a lazy topic only if someone subscribes or queries.
            camera: For a message without a header, or a function, if the node serves several
                cameras.
        """
        if isinstance(message, Stamped):
            camera = message.header.camera
        self._publisher(topic, self._camera(camera)).offer(
            lambda: Outgoing.message(message if isinstance(message, Message) else message())
        )

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
        bits: bool = False,
    ) -> None:
        """Publish a picture made from a frame, if someone subscribes; keep it for queries.

        Args:
            topic: Says whether the picture is encoded as JPEG or PNG.
            frame: The frame from which it was made.
            picture: Pixels, or a function that makes them. It is called at most once, perhaps
                later and on another thread, so it must not use a borrowed frame (``Frame.keep``).
            encoding: Of the pixels: ``bgr8`` or ``mono8``.
            quality: JPEG quality, 1 to 100.
            jpeg: True or False overrides the topic.
            bilevel: All pixels are 0 or 255: a PNG then has one bit each.
            bits: All pixels are 0 or 255: send packed bits instead of a PNG or JPEG.
        """
        publisher = self._publisher(topic, frame.header.camera)
        as_jpeg = publisher.topic.encoding == JPEG if jpeg is None else jpeg

        def make() -> Outgoing:
            pixels = picture() if callable(picture) else picture
            return encoded_picture(
                pixels,
                self.header(frame, encoding),  # made after the work, whose end is ``done_ns``
                jpeg_quality=quality if as_jpeg else None,
                bilevel=bilevel,
                bits=bits,
            )

        publisher.offer(make)

    def publish_frame(
        self,
        frame: Frame,
        may_send: Callable[[Frame], bool] = lambda _: True,
        *,
        not_decoded: Callable[[PayloadError], None],
    ) -> bool:
        """Publish a camera's own frame: in shared memory, compressed and raw, each if asked for.

        Args:
            frame: The frame.
            may_send: Tells whether to send it compressed; called only if someone subscribes to
                that.
            not_decoded: Called if it was sent compressed, but its pixels, which others asked for,
                cannot be decoded.

        Returns:
            Whether it was sent in any of these forms.

        Raises:
            ValueError: The node publishes neither ``image/compressed`` nor ``image`` of the camera.
            PayloadError: The picture can neither be encoded nor decoded.
        """
        outputs = self._frame_outputs(frame.header.camera)
        offer, decode_for_it = outputs.offer, frame.is_compressed
        shared = sent = False
        if offer is not None and not decode_for_it:  # first, as it takes the least time
            shared = offer.write(frame)
        if outputs.compressed is not None:
            sent = outputs.compressed.offer(
                lambda: Outgoing(frame.compressed, frame.mime, frame.compressed_header.to_bytes()),
                lambda: may_send(frame),
            )
        try:
            if outputs.raw is not None:
                sent |= outputs.raw.offer(
                    lambda: Outgoing(frame.raw, RAW_IMAGE, frame.header.to_bytes())
                )
            if offer is not None and decode_for_it:
                shared = offer.write(frame)
        except PayloadError as error:
            if not sent:
                raise
            not_decoded(error)
        return sent or shared

    def limit_replies(self, topic: Topic | str, camera: str, may_reply: MayReply) -> None:
        """Set the function that is asked before each reply on a topic; see ``StreamPublisher``.

        Raises:
            ValueError: The node does not publish the topic of the camera.
        """
        self._publisher(topic, camera).may_reply = may_reply

    def check_camera(self, camera: str) -> None:
        """Check that frames of a camera can be published.

        Raises:
            ValueError: The node publishes neither ``image/compressed`` nor ``image`` of it.
        """
        self._frame_outputs(camera)

    def _frame_outputs(self, camera: str) -> FrameOutputs:
        found = self._frames.get(camera)
        if found is None:
            raise self._not_published(COMPRESSED.name, camera)
        return found

    def _offers(self) -> list[SharedMemoryOffer]:
        return [each.offer for each in self._frames.values() if each.offer is not None]

    def _camera(self, named: str | None) -> str:
        """Return the camera of this name, or the node's only one."""
        if named is not None:
            return named
        if len(self._cameras) != 1:
            raise ValueError(f"{self._node} serves {self._cameras}: name the camera")
        return self._cameras[0]

    def _publisher(self, topic: Topic | str, camera: str) -> StreamPublisher:
        name = topic if isinstance(topic, str) else topic.name
        found = self._publishers.get((name, camera))
        if found is None:
            raise self._not_published(name, camera)
        return found

    def _not_published(self, topic: str, camera: str) -> ValueError:
        published = "; ".join(map(_listed, self._topics.items())) or "nothing"
        return ValueError(
            f"{self._node} does not publish {topic} of {camera}; it publishes {published}"
        )


def _listed(item: tuple[str, Sequence[Topic]]) -> str:
    camera, topics = item
    return f"{', '.join(topic.name for topic in topics) or 'nothing'} of {camera}"
