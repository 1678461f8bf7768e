"""The outputs of a node: messages, pictures made from frames, and a camera's own frames."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Literal

import zenoh

from zenoh_vision.config.roles import value_of
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import forms
from zenoh_vision.image.forms import PictureForm
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.picture import Picture, PixelPicture, check_size, lasting, picture_of
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import Header, Stamped
from zenoh_vision.node.core import Core
from zenoh_vision.node.frame_input import transport_from_environment
from zenoh_vision.node.memory_offer import MemoryOffer
from zenoh_vision.node.query_server import Answer, QueryServer
from zenoh_vision.shm.machine import why_impossible
from zenoh_vision.topics import COMPRESSED, RAW, Topic, topic_named
from zenoh_vision.transport.publisher import Outcome, Outgoing, ReplyLimit, StreamPublisher

Publishes = Sequence[Topic | str] | Mapping[str, Sequence[Topic | str]]
"""The topics of each camera of a node, or those of all its cameras; a topic, or its name."""

QUALITY = 80

RANKED: tuple[Outcome, ...] = ("sent", "withheld", "unwanted")
"""Outcomes of the ways of a frame; the first that one of them had is that of the frame."""

AnyPicture = Picture | Pixels | bytes
Compress = Callable[[Frame], bytes | None]


@dataclass(frozen=True, slots=True)
class Published:
    """What became of a picture; true if it was sent to someone.

    Attributes:
        outcome: ``sent``; ``unwanted``: nobody subscribes, and it is kept for queries;
            ``withheld``: its publisher's limit of bandwidth; ``dropped``: it is no picture that can
            be sent, which is counted and logged.
        frame: The frame, from which other results can be made; None if it was dropped.
    """

    outcome: Outcome | Literal["dropped"]
    frame: Frame | None

    def __bool__(self) -> bool:
        return self.outcome == "sent"


@dataclass(frozen=True, slots=True)
class FrameOutputs:
    """The ways of one camera's own frames; None for those that the node does not have."""

    compressed: StreamPublisher | None
    raw: StreamPublisher | None
    memory: MemoryOffer | None


class Outputs:
    """The publishers of a node, one for each topic and camera that it publishes.

    Raises:
        ConfigurationError: The environment names a transport that does not exist.
        ValueError: The table has no topic of a name, or the node does not serve a camera.
    """

    def __init__(self, core: Core, publishes: Publishes) -> None:
        by_camera = (
            publishes if isinstance(publishes, Mapping) else dict.fromkeys(core.cameras, publishes)
        )
        for camera in by_camera:
            if camera not in core.cameras:
                raise ValueError(f"{core.name} publishes of {camera!r}, but serves {core.cameras}")
        self._core = core
        self._topics = {
            camera: tuple(map(topic_named, topics)) for camera, topics in by_camera.items()
        }
        # A sequence of topics is known even while there is no camera yet.
        self._named = () if isinstance(publishes, Mapping) else tuple(map(topic_named, publishes))
        self._publishers: dict[tuple[str, str], StreamPublisher] = {}
        self._frames: dict[str, FrameOutputs] = {}
        self._last: dict[str, tuple[int, int]] = {}  # epoch and seq of each camera's own frames
        self._server: QueryServer | None = None
        self._may_put_off = True  # as only the newest payloads count, and only for queries
        self._put_off: dict[str, Callable[[], object]] = {}  # by camera
        self._lock = threading.Lock()  # of what was put off
        told = transport_from_environment()
        self._may_offer = told in (None, "auto", "shm") and not why_impossible()

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics of all cameras, those of cameras that were added included."""
        found = [*self._named, *(topic for topics in self._topics.values() for topic in topics)]
        return tuple(dict.fromkeys(found))

    @property
    def keys(self) -> list[str]:
        """The keys that it publishes; empty before ``declare``."""
        return [publisher.key for publisher in self._publishers.values()]

    # Declarations

    def declare(self, server: QueryServer) -> None:
        """Declare a publisher for each topic and camera; the node's link is open."""
        self._server = server
        for camera, topics in self._topics.items():
            self._declare(camera, topics)

    def add_camera(self, camera: str, topics: Sequence[Topic | str]) -> None:
        """Declare the topics of one more camera; after ``declare``.

        Raises:
            RuntimeError: Before ``declare``.
            ValueError: The table has no topic of a name.
        """
        added = tuple(map(topic_named, topics))
        self._declare(camera, added)
        self._topics = {**self._topics, camera: added}

    def _declare(self, camera: str, topics: Sequence[Topic]) -> None:
        core, link = self._core, self._core.link
        new = {
            (topic.name, camera): self._declared(topic.key(core.namespace, camera), topic)
            for topic in topics
            if not topic.by_query
        }
        self._publishers = {**self._publishers, **new}  # other threads may iterate over the old one
        compressed, raw = new.get((COMPRESSED.name, camera)), new.get((RAW.name, camera))
        if compressed is not None or raw is not None:
            memory = None
            # Where each frame must arrive it is a message; in shared memory only the newest waits.
            newest_wins = all(each.delivery == "frame" for each in topics if each.message is None)
            if self._may_offer and newest_wins:
                memory = MemoryOffer(link, core.namespace, camera, core.clock)
            self._frames = {**self._frames, camera: FrameOutputs(compressed, raw, memory)}

    def add_stream(self, key: str, topic: Topic) -> StreamPublisher:
        """Declare a key of any name; see ``Node.add_stream``."""
        added = self._declared(key, topic)
        self._publishers = {**self._publishers, (key, ""): added}
        return added

    def _declared(self, key: str, topic: Topic) -> StreamPublisher:
        """Return a publisher of a key.

        Raises:
            RuntimeError: The node is not open.
        """
        core, link, server = self._core, self._core.link, self._server
        assert server is not None

        def queue(query: zenoh.Query, answer: Answer) -> None:
            def answer_newest(query: zenoh.Query) -> None:
                self._publish_put_off()
                answer(query)

            server.queue(query, answer_newest)

        self._may_put_off &= topic.lazy and topic.keeps == 1 and not topic.recent
        return StreamPublisher(link, topic, key, queue, core.health.log_drop)

    @property
    def shared_memory_failure(self) -> str:
        """Why frames cannot be offered in shared memory now; empty if they can, or never were."""
        return "; ".join(offer.failure for offer in self._offers() if offer.failure)

    def close(self) -> None:
        """Withdraw the offers of shared memory; the end of the session does the rest."""
        for offer in self._offers():
            offer.close()

    def limit_replies(self, topic: Topic | str, camera: str, limit: ReplyLimit) -> None:
        """Set the function that is asked before each reply on a topic; see ``StreamPublisher``.

        Raises:
            ValueError: The node does not publish the topic of the camera.
        """
        self._publisher(topic, camera).limit = limit

    # Publishing

    def wanted(self, topic: Topic | str, camera: str | None) -> bool:
        """Tell whether someone subscribes to a topic; see ``Node.wanted``."""
        return self._publisher(topic, self._core.camera(camera)).demand.exists

    def publish_if_wanted(self, frame: Frame, publish: Callable[[], object]) -> None:
        """Call a function that publishes, or put it off; see ``Node.publish_if_wanted``."""
        may_wait = self._may_put_off and not any(map(_is_wanted, self._publishers.values()))
        with self._lock:
            if may_wait:
                self._put_off[frame.header.camera] = publish
                return
            self._put_off.pop(frame.header.camera, None)
        publish()

    def _publish_put_off(self) -> None:
        """Publish the results that a query may ask for, on the thread of queries."""
        with self._lock:  # until they are published, so that no newer ones are before
            while self._put_off:
                self._put_off.popitem()[1]()

    def header(self, source: Frame | Stamped, encoding: str | None = None) -> Header:
        """Return the header of a result: the frame's identity, this node's name and revision."""
        # The newest revision is activated before each item, and a frame keeps that of its turn.
        # What a message says of the arrival of a frame is of another node, by another clock.
        revision, received_ns = (
            (source.revision, source.header.received_ns)
            if isinstance(source, Frame)
            else (self._core.revision, None)
        )
        return source.header.model_copy(
            update={
                "encoding": encoding,
                "node": self._core.name,
                "revision": 0 if revision is None else revision.number,
                "received_ns": received_ns,
                "done_ns": self._core.clock.time_ns(),
            }
        )

    def publish(
        self, topic: Topic | str, message: Message | Callable[[], Message], camera: str | None
    ) -> bool:
        """Publish a message; see ``Node.publish``."""
        header = message.header if isinstance(message, Stamped) else None
        camera = self._core.camera(camera) if header is None else header.camera
        publisher = self._publisher(topic, camera)
        if not callable(message):  # a wrong one is refused also while nobody subscribes
            _check_class(publisher.topic, message)

        def outgoing() -> Outgoing:
            if not callable(message):
                return Outgoing.message(message)
            made = message()
            _check_class(publisher.topic, made)
            return Outgoing.message(made)

        frame = None if header is None else (header.epoch, header.seq)
        return publisher.offer(outgoing, frame=frame) == "sent"

    def publish_bytes(
        self,
        topic: Topic | str,
        payload: bytes,
        encoding: str,
        attachment: bytes | None,
        camera: str | None,
    ) -> bool:
        """Publish a payload as it is; see ``Node.publish_bytes``."""
        form = forms.FORMS.get(encoding)
        answers = form is None or form.stands_alone
        outgoing = Outgoing(payload, encoding, attachment, answers)
        publisher = self._publisher(topic, self._core.camera(camera))
        return publisher.offer(lambda: outgoing) == "sent"

    def publish_result(
        self,
        topic: Topic | str,
        frame: Frame,
        picture: AnyPicture | Callable[[], AnyPicture],
        *,
        encoding: str | None,
        quality: int,
        form: str | None,
        bilevel: bool,
    ) -> Published:
        """Publish a picture made from a frame; see ``Node.publish_picture``."""
        publisher = self._publisher(topic, frame.header.camera)
        chosen = forms.FORMS[publisher.topic.encoding] if form is None else forms.form_named(form)
        if not callable(picture):
            picture = _picture(picture, encoding, bilevel=bilevel)

        def make() -> Outgoing:
            made = picture
            if callable(made):
                made = _picture(made(), encoding, bilevel=bilevel, own=True)
            payload = chosen.make(made, quality)
            # The header is made after the work, whose end is ``done_ns``.
            return _outgoing(chosen, payload, self.header(frame, made.encoding), made)

        return Published(publisher.offer(make), frame)

    def publish_own(
        self,
        picture: AnyPicture,
        *,
        camera: str | None,
        encoding: str | None,
        quality: int,
        stamp_ns: int | None,
        new_epoch: bool,
        compress: Compress | None,
    ) -> Published:
        """Publish a picture as the next frame of a camera; see ``Node.publish_picture``."""
        core = self._core
        camera = core.camera(camera)
        if camera not in self._frames:
            raise self._not_published(COMPRESSED.name, camera)
        core.health.loop_alive()
        core.counters.arrive()
        revision = core.revision
        epoch, seq = self._identify(camera, new_epoch=new_epoch)
        try:
            shown = _picture(picture, encoding)
            check_size(*shown.size)
            header = Header(
                camera=camera,
                epoch=epoch,
                seq=seq,
                stamp_ns=core.clock.time_ns() if stamp_ns is None else stamp_ns,
                width=shown.width,
                height=shown.height,
                encoding=shown.encoding,
                node=core.name,
                revision=0 if revision is None else revision.number,
            )
            if revision is not None:
                quality = value_of(revision.settings, "quality", quality)
            frame = Frame(header, shown, quality=quality, revision=revision, captured=True)
        except PayloadError as error:
            core.drop(error)
            core.activate()
            return Published("dropped", None)
        published = self.publish_frame(COMPRESSED, frame, compress)
        core.activate()
        return published

    def publish_frame(
        self, topic: Topic | str, frame: Frame, compress: Compress | None = None
    ) -> Published:
        """Publish a frame under its own header; see ``Node.publish_picture``.

        A camera's own frames go in shared memory, compressed and raw, each if someone asks for it.
        """
        name = topic if isinstance(topic, str) else topic.name
        if name not in (COMPRESSED.name, RAW.name):
            publisher = self._publisher(topic, frame.header.camera)
            form = forms.FORMS[publisher.topic.encoding]
            return Published(publisher.offer(lambda: _of_frame(frame, form)), frame)
        outputs = self._frames.get(frame.header.camera)
        if outputs is None:
            raise self._not_published(COMPRESSED.name, frame.header.camera)
        try:
            outcome = self._publish_all_ways(outputs, frame, compress)
        except PayloadError as error:
            if not frame.captured:
                raise
            frame.captured = False
            self._core.drop(error)
            return Published("dropped", None)
        except BaseException:
            if frame.captured:  # the node ends, with counters that balance
                self._core.counters.drop("failed")
            raise
        if frame.captured:
            frame.captured = False
            if outcome == "sent":
                self._core.counters.finish()
            elif outcome == "withheld":
                self._core.counters.drop("over_budget")
            else:
                self._core.counters.drop("no_subscriber")
            self._core.health.done(frame.header.age_start_ns)
        return Published(outcome, frame)

    def _publish_all_ways(
        self, outputs: FrameOutputs, frame: Frame, compress: Compress | None
    ) -> Outcome:
        """Publish a frame in each way that someone asks for, the cheapest first.

        Raises:
            PayloadError: It was sent in no way, and can neither be encoded nor decoded.
        """
        found: set[Outcome] = set()
        failure: PayloadError | None = None

        def to_send() -> Outgoing | None:
            data = frame.compressed if compress is None else compress(frame)
            return None if data is None else _compressed(frame, data)

        try:
            if outputs.memory is not None and outputs.memory.write(frame):
                found.add("sent")
        except PayloadError as error:
            failure = error
        try:
            if outputs.compressed is not None:
                kept = lambda: _compressed(frame, frame.compressed)  # noqa: E731
                header = frame.header
                at, held = (header.epoch, header.seq), header.width * header.height * 3
                found.add(outputs.compressed.offer(kept, to_send, at, held))
        except PayloadError as error:
            failure = error
        try:
            if outputs.raw is not None:
                found.add(outputs.raw.offer(lambda: _of_frame(frame, forms.RAW_FORM)))
        except PayloadError as error:
            failure = error
        if failure is not None and "sent" not in found:
            raise failure
        if failure is not None:  # sent as it is, but not as pixels
            self._core.counters.note("not_decoded")
            self._core.health.log_drop(failure)
        return min(found, key=RANKED.index, default="unwanted")

    def _identify(self, camera: str, *, new_epoch: bool) -> tuple[int, int]:
        """Return epoch and seq of the next frame; epochs never run backwards."""
        epoch, seq = self._last.get(camera, (0, 0))
        if new_epoch or not epoch:
            epoch, seq = max(epoch + 1, self._core.clock.time_ns()), 0
        else:
            seq += 1
        self._last[camera] = (epoch, seq)
        return epoch, seq

    def _offers(self) -> list[MemoryOffer]:
        return [each.memory for each in self._frames.values() if each.memory is not None]

    def _publisher(self, topic: Topic | str, camera: str) -> StreamPublisher:
        name = topic if isinstance(topic, str) else topic.name
        found = self._publishers.get((name, camera))
        if found is None:
            raise self._not_published(name, camera)
        return found

    def _not_published(self, topic: str, camera: str) -> Exception:
        if self._core.opened_link is None:
            return self._core.not_open()
        named = {
            camera: ", ".join(each.name for each in topics if not each.by_query)
            for camera, topics in self._topics.items()
        }
        listed = (f"{names or 'nothing'} of {camera}" for camera, names in named.items())
        published = "; ".join(listed) or "nothing"
        return ValueError(
            f"{self._core.name} does not publish {topic} of {camera}; it publishes {published}"
        )


def _check_class(topic: Topic, message: object) -> None:
    """Raise TypeError unless a message is of the class that its topic carries."""
    if topic.message is None:
        raise TypeError(f"{topic.name} carries pictures, not messages; take node.publish_picture")
    if not isinstance(message, topic.message):
        expected, found = topic.message.__name__, type(message).__name__
        raise TypeError(f"{topic.name} carries {expected}, not {found}")


_is_wanted = attrgetter("demand.exists")
"""Tells whether someone subscribes to the key of a publisher."""


def _picture(
    picture: AnyPicture, encoding: str | None, *, bilevel: bool = False, own: bool = False
) -> Picture:
    """Return pixels or the bytes of a file as a picture that does not change any more.

    Pixels are copied if they can be written to, unless they are our ``own``: made for this.
    """
    if isinstance(picture, Picture):
        return picture
    if isinstance(picture, bytes):
        return picture_of(picture, encoding)
    return PixelPicture(picture if own else lasting(picture), encoding, bilevel=bilevel)


def _compressed(frame: Frame, data: bytes) -> Outgoing:
    """Return the compressed bytes of a frame to send; they may show a smaller picture of it."""
    form = forms.form_of(frame.picture.mime, data)
    header = form.header(frame.header)
    return Outgoing(data, form.encoding, header.to_bytes(), form.stands_alone)


def _of_frame(frame: Frame, form: PictureForm) -> Outgoing:
    """Return a frame in a form, at full size if only its header says the size."""
    picture = frame.picture
    if form.needs_header and frame.is_reduced:
        picture = PixelPicture(frame.pixels, picture.encoding)
    header = form.header(frame.header)
    payload = form.make(picture, frame.quality)
    return Outgoing(payload, form.encoding, header.to_bytes(), form.stands_alone)


def _outgoing(form: PictureForm, payload: bytes, header: Header, picture: Picture) -> Outgoing:
    """Return a payload with the header that fits it.

    A picture that was made by ``Picture.scaled`` keeps its frame's coordinates. Any other of
    another size, such as a crop, has coordinates of its own, and its header says its size.
    """
    if picture.size != (header.width, header.height) and (
        form.needs_header or not picture.is_reduced
    ):
        width, height = picture.size
        header = header.model_copy(update={"width": width, "height": height})
    return Outgoing(payload, form.encoding, form.header(header).to_bytes(), form.stands_alone)
