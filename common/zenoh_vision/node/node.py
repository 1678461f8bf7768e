"""``Node``: manages everything of a process on the network except a service's loop.

```python
with Node("brightness", camera="front", publishes=[BRIGHTNESS]) as node:
    for frame in node.frames("image/compressed", want="gray"):
        node.publish(BRIGHTNESS, Brightness(header=node.header(frame), mean=frame.gray.mean()))
```

The iteration ends at SIGINT or SIGTERM, and so does the ``with``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import ExitStack
from typing import Any, Literal, Self, TypeVar, overload

from zenoh_vision import keys
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.config.settings import Settings
from zenoh_vision.errors import ConfigurationError, PayloadError
from zenoh_vision.health.health import Health
from zenoh_vision.host.clock import SYSTEM_CLOCK, Clock
from zenoh_vision.host.signals import StopSignals
from zenoh_vision.image.frame import Frame, Want
from zenoh_vision.image.limits import MAX_PIXELS
from zenoh_vision.image.picture import Picture
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.keys import Transport
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import Header, Stamped
from zenoh_vision.node.announcement import Announcement
from zenoh_vision.node.core import Core
from zenoh_vision.node.frame_input import MAX_AGE_S, FrameInput
from zenoh_vision.node.inputs import Input, arrivals, check_rate, merged, ticks
from zenoh_vision.node.outputs import QUALITY, Compress, Outputs, Published, Publishes
from zenoh_vision.node.pairs import DEPTH, TOLERANCE_S, WAIT_S, paired
from zenoh_vision.node.queries import Queries
from zenoh_vision.stream.buffer import Buffering, latest, queue
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.intake import MessageIntake, SampleIntake
from zenoh_vision.stream.sample import Sample
from zenoh_vision.topics import COMPRESSED, RAW, TOPICS, Topic, topic_named
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.link import Link
from zenoh_vision.transport.publisher import ReplyLimit, StreamPublisher

COUNTS = ("received", "processed")
CAMERA_COUNTS = ("captured", "published")

A = TypeVar("A")
B = TypeVar("B")


class Node:
    """A node of the system: opened by ``with``, stopped by a signal or ``stop()``.

    Args:
        service: Kind of node: ``tracker``.
        name: Of the node, if it is another than these.
        camera: The camera it serves; its name is then ``{service}_{camera}``. Several or none:
            a tuple of them, and its name is ``{service}``.
        connection: Where the router is.
        publishes: Topics, or their names in the table; of several cameras that have different
            ones, a mapping: ``{"left": ["depth"], "right": []}``. Only their keys are declared.
            It answers queries for the schemas of their messages.
        counts: Names of the counters of arrivals and of finished items; by default ``captured`` and
            ``published`` of a node that publishes ``image/compressed`` or ``image``, ``received``
            and ``processed`` of any other.
        parameters: Its settings, or a store of them. Those marked ``Live`` are parameters under
            the node's name; the newest revision is activated between two frames.

        clock: What the node reads the time from.

    Attributes:
        name, service, connection, parameters, counters, health: As they were given or made.

    Raises:
        ConfigurationError: A name has other characters than a-z, 0-9 and _, or the environment
            names a transport that does not exist.
    """

    def __init__(
        self,
        service: str,
        *,
        name: str = "",
        camera: str | Sequence[str] = keys.DEFAULT_CAMERA,
        connection: Connection | None = None,
        publishes: Publishes = (),
        counts: tuple[str, str] | None = None,
        parameters: ParameterStore[Any] | Settings | None = None,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self.connection = connection or Connection()
        cameras = (camera,) if isinstance(camera, str) else tuple(camera)
        for each in (service, *filter(None, [name]), *cameras, self.connection.namespace):
            if not keys.is_name(each):
                raise ConfigurationError(f"{each!r} is no name: allowed are a-z, 0-9 and _")
        self.service = service
        self.name = name or (f"{service}_{camera}" if isinstance(camera, str) else service)
        if isinstance(parameters, Settings):
            parameters = ParameterStore(parameters)
        self.parameters = parameters
        by_camera = publishes.values() if isinstance(publishes, Mapping) else [publishes]
        topics = {topic_named(topic).name for topics in by_camera for topic in topics}
        is_camera = {COMPRESSED.name, RAW.name} & topics
        self.counters = FrameCounters(*counts or (CAMERA_COUNTS if is_camera else COUNTS))
        self.health = Health(self.name, self.counters, clock)
        self._core = Core(
            self.name,
            service,
            cameras,
            self.connection,
            self.counters,
            self.health,
            parameters,
            clock,
        )
        self._outputs = Outputs(self._core, publishes)
        self._queries = Queries(self._core, self._outputs)
        self._announcement = Announcement(self._core, self._outputs)
        self._open = ExitStack()

    # Life

    def __enter__(self) -> Self:
        """Open the session, waiting for the router; declare what the node offers.

        Raises:
            RouterUnreachable: No router within the connection's time, if it has one.
            ToldToStop: Told to stop before there was one.
            RuntimeError: It was opened before.
        """
        core, server = self._core, self._queries.server
        if core.opened_link is not None:
            raise RuntimeError(f"{core.name} was opened before; make another Node")
        with ExitStack() as opening:
            opening.enter_context(StopSignals(self.stop))
            core.opened_link = Link(
                self.connection,
                self._give_up_waiting,
                lambda: core.stopping,
                refused=self._announcement.note_refusal,
            )
            opening.callback(core.opened_link.close)
            opening.callback(self._outputs.close)
            self._outputs.declare(server)
            self._announcement.declare(server)
            opening.callback(self._queries.declare())
            server.start()
            opening.callback(server.close)
            self._announcement.start()
            opening.callback(self._announcement.close)
            opening.callback(self._close_inputs)
            self._open = opening.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        """Send the last diagnostics and close the session, in bounded time."""
        self._core.stopping = True
        self._open.close()

    def _close_inputs(self) -> None:
        with ExitStack() as closing:
            for each in tuple(self._core.inputs):
                closing.callback(each.close)

    @property
    def cameras(self) -> tuple[str, ...]:
        """The cameras that the node serves."""
        return self._core.cameras

    @property
    def camera(self) -> str:
        """The camera that the node serves, if it serves only one."""
        return self._core.camera(None)

    @property
    def link(self) -> Link:
        """Its link to the router, inside the ``with``, for declarations and queries of your own."""
        return self._core.link

    @property
    def stopping(self) -> bool:
        """Whether a stop was requested."""
        return self._core.stopping

    @property
    def inputs(self) -> Set[Input[Any]]:
        """Its open inputs."""
        return self._core.inputs

    def stop(self) -> None:
        """End the iterations at once; safe in a signal handler and from any thread."""
        self._core.stopping = True
        self.wake()

    def _give_up_waiting(self) -> bool:
        self._announcement.beat()
        return self._core.stopping

    # Inputs

    def frames(
        self,
        topic: Topic | str = COMPRESSED,
        *,
        camera: str | None = None,
        want: Want = "bgr",
        max_age_s: float | None = MAX_AGE_S,
        buffering: Buffering = latest,
        max_pixels: int = MAX_PIXELS,
        transport: Transport | None = None,
    ) -> Input[Frame]:
        """Return an iterable of frames, without damaged, duplicate and stale ones.

        A frame that waits in a queue for longer than ``max_age_s`` is stale: a consumer that
        needs every frame passes ``buffering=queue(n), max_age_s=None``.

        Args:
            topic: ``image/compressed`` or ``image``, or another topic that carries pictures.
            camera: The camera, if the node serves several; ``*`` for all.
            want: The view that is decoded beforehand, so that its errors are counted here; or a
                function that decodes what the loop needs of a frame, such as a reduced size. The
                frame has its ``revision`` already when the function is called.
            max_age_s: Frames that are more than this later than the fastest of the last minute are
                dropped as ``stale``. If the node has a setting of the type ``MaxAge``, that holds
                instead. None drops none, whatever the settings.
            buffering: ``latest``, or ``queue(n)`` for frames in order of arrival.
            max_pixels: Larger frames are dropped as ``too_large`` before they are decoded.
            transport: ``auto``: the camera's frames in shared memory if both are on one machine and
                have the extra ``shm``, else the compressed ones if they are published, else the raw
                pixels; ``shm``, ``jpeg`` or ``raw``: only these. If the node has a setting of the
                type ``FrameTransport``, that holds instead. It needs the topic
                ``image/compressed`` of one camera. None: ``ZV_TRANSPORT`` of the environment, or
                else ``auto``, for that topic of one camera without a queue; for any other input,
                its topic over the network.

        Raises:
            TypeError: ``buffering`` is neither ``latest`` nor a ``queue(n)``.
            ValueError: The node does not serve the camera, the topic carries no pictures, there is
                no such form or transport, the transport does not fit the topic, or a limit is not
                above 0.
            ConfigurationError: The transport is ``shm``, which this process cannot use.
        """
        return FrameInput(
            self._core,
            topic_named(topic),
            self._core.camera(camera),
            want=want,
            max_age_s=max_age_s,
            buffering=buffering,
            max_pixels=max_pixels,
            transport=transport,
        )

    def messages(
        self,
        topic: Topic | str,
        *,
        camera: str | None = None,
        message: type[Message] | None = None,
        buffering: Buffering = queue(64),  # noqa: B008 - a frozen value
    ) -> Input[Message]:
        """Return an iterable of messages, decoded and checked.

        Args:
            topic: A topic, its name in the table, or a key expression, which has a ``/`` and may
                have wildcards: ``@vision/diagnostics/*``.
            camera: As for ``frames``; only for topics.
            message: Class of the messages of a key expression; None takes the one that the
                encoding of each names.
            buffering: How many wait; a full queue drops its oldest.

        Raises:
            ValueError: The table has no topic of this name, or it carries pictures.
        """
        if isinstance(topic, Topic) or topic in TOPICS or "/" not in topic:
            row = topic_named(topic)
            key = row.key(self._core.namespace, self._core.camera(camera))
            message = row.message
            if message is None and row.name in TOPICS:
                raise ValueError(f"{row.name} carries pictures, not messages; take node.frames")
        else:
            key = topic
        intake = MessageIntake(key, self._core.consumer, buffering, message=message)
        return Input(self._core, intake)

    def samples(
        self,
        key: str,
        *,
        buffering: Buffering = queue(1000),  # noqa: B008 - a frozen value
    ) -> Input[Sample]:
        """Return an iterable of the samples on a key expression (``vision/**``), unchecked.

        A deletion is a sample too: its ``deleted`` is set.
        """
        intake = SampleIntake(key, self._core.consumer, buffering)
        return Input(self._core, intake)

    def receive(self, *inputs: Input[Any], every_s: float | None = None) -> Iterator[Any]:
        """Yield the items of several inputs in one loop, until the node is told to stop.

        Args:
            inputs: Of this node.
            every_s: Yield None in this interval too, whether items arrive or not: for what must
                happen when an input is silent. None: never.
        """
        return merged(self._core, inputs, every_s)

    def arrivals(
        self, *inputs: Input[Any], is_due: Callable[[], object]
    ) -> Iterator[tuple[Input[Any], Any] | None]:
        """Yield items with their inputs, for a loop that finishes an item after the next ones.

        The loop calls ``done`` of the input with each item, or ``drop``; until then the item is
        pending. Between items it gets None: at least each 0.1 s, and soon after ``wake``.

        Args:
            inputs: Of this node.
            is_due: Whether there is something to do without an item; asked after each ``wake``.
        """
        return arrivals(self._core, inputs, is_due)

    def wake(self) -> None:
        """Wake the loop over ``arrivals``; safe from any thread."""
        self._core.consumer.filled.set()

    @overload
    def pairs(
        self,
        first: Input[A],
        second: Input[B],
        *,
        tolerance_s: float = ...,
        wait_s: float = ...,
        depth: int = ...,
        alone: Literal[False] = ...,
    ) -> Iterator[tuple[A, B]]: ...

    @overload
    def pairs(
        self,
        first: Input[A],
        second: Input[B],
        *,
        tolerance_s: float = ...,
        wait_s: float = ...,
        depth: int = ...,
        alone: Literal[True],
    ) -> Iterator[tuple[A | None, B | None]]: ...

    def pairs(
        self,
        first: Input[Any],
        second: Input[Any],
        *,
        tolerance_s: float = TOLERANCE_S,
        wait_s: float = WAIT_S,
        depth: int = DEPTH,
        alone: bool = False,
    ) -> Iterator[tuple[Any, Any]]:
        """Yield items of two inputs whose stamps are close, until the node is told to stop.

        Each item is in one pair at most, and pairs come in the order of their stamps. An item
        without a partner is dropped as ``unpaired``. While one camera is gone, there are no pairs:
        each frame of the other one is dropped after ``wait_s``, or yielded with ``alone``, and the
        node's health says which camera is silent. Cameras on two machines need synchronized clocks,
        since stamps are compared directly.

        Args:
            first: Frames, or messages that carry a header.
            second: The same of another camera or topic.
            tolerance_s: By how much the stamps of a pair may differ; 0 for results of the same
                frame, less than half of the time between two frames for two cameras.
            wait_s: How long an item waits for its partner.
            depth: Most items of an input that wait.
            alone: Also yield items without a partner, with None in place of the other.

        Raises:
            ValueError: The two inputs are the same, or a limit is not allowed.
        """
        return paired(
            self._core,
            first,
            second,
            tolerance_s=tolerance_s,
            wait_s=wait_s,
            depth=depth,
            alone=alone,
        )

    # A camera of one's own

    def rate(self, rate_hz: float) -> Iterator[int]:
        """Yield 0, 1, 2, ... at a rate until the node is told to stop.

        An iteration that takes too long delays the next one, but missed ones are not made up for.
        The newest parameters are activated before each.
        """
        return ticks(self._core, rate_hz)

    def add_camera(self, name: str, publishes: Sequence[Topic | str] = ()) -> None:
        """Serve one more camera, such as one whose first frame arrived on an input of all cameras.

        Its topics are declared, and the node's description names it from now on.

        Raises:
            ConfigurationError: The name has other characters than a-z, 0-9 and _.
            RuntimeError: The node is not open.
            ValueError: The table has no topic of a name.
        """
        if not keys.is_name(name):
            raise ConfigurationError(f"{name!r} is no name: allowed are a-z, 0-9 and _")
        if name not in self._core.cameras:
            self._outputs.add_camera(name, publishes)
            self._core.cameras = (*self._core.cameras, name)

    def expect_rate(self, rate_hz: float | None) -> None:
        """Say how many frames a second are expected, so that the health can tell too few.

        Raises:
            ValueError: The rate is not above 0 and finite; None if none is known.
        """
        if rate_hz is not None:
            check_rate(rate_hz)
        self.health.rates.expect(rate_hz)

    def drop(self, error: PayloadError) -> None:
        """Count one pending item as dropped, and log it once per burst.

        In a loop over inputs it is the item in work, which then does not count as processed.
        """
        self._core.drop_in_work(error)

    def report(self, condition: str, level: int, message: str = "") -> None:
        """Report a condition of the service in the node's health, until its next report.

        Args:
            condition: Its name; each condition is reported and ends on its own.
            level: A ``Level``; ``OK`` without a message ends the condition.
            message: For people.

        Raises:
            ValueError: There is no such level.
        """
        self.health.report(condition, level, message)

    # Outputs

    def header(self, source: Frame | Stamped, encoding: str | None = None) -> Header:
        """Return the header of a result: the frame's identity, this node's name and revision.

        Args:
            source: The frame from which the result was made, or another node's message about it.
            encoding: Of the result's pixels, if it is a picture.
        """
        return self._outputs.header(source, encoding)

    def publish(
        self,
        topic: Topic | str,
        message: Message | Callable[[], Message],
        *,
        camera: str | None = None,
    ) -> bool:
        """Publish a message.

        Args:
            topic: A topic that the node publishes.
            message: The message, published for the camera in its header, if it has one; or a
                function that makes it. The function is called at most once, perhaps later and on
                another thread, and for a lazy topic only if someone subscribes or queries.
            camera: For a message without a header, or a function, if the node serves several
                cameras.

        Returns:
            Whether it was sent: not so on a lazy topic to which nobody subscribes.

        Raises:
            TypeError: It is no message of the class that the topic carries, and no function.
            ValueError: The node does not publish the topic of the camera.
        """
        return self._outputs.publish(topic, message, camera)

    def wanted(self, topic: Topic | str, camera: str | None = None) -> bool:
        """Tell whether someone subscribes to a topic.

        Args:
            topic: One that the node publishes.
            camera: If the node has several.

        Raises:
            ValueError: The node does not publish the topic of the camera.
        """
        return self._outputs.wanted(topic, camera)

    def publish_if_wanted(self, frame: Frame, publish: Callable[[], object]) -> None:
        """Publish the results of a frame by a function, if someone subscribes to any of them.

        If nobody does, the function of the newest frame of each camera is kept until a query asks.
        So a frame whose results nobody wants costs one question instead of one for each topic.

        Args:
            frame: From which the results are made.
            publish: Publishes them. It is called at most once, perhaps later and on another thread;
                at once if a topic of the node is not lazy, or keeps more than its newest payload.
        """
        self._outputs.publish_if_wanted(frame, publish)

    def publish_picture(
        self,
        topic: Topic | str,
        picture: Frame | Picture | Pixels | bytes | Callable[[], Picture | Pixels | bytes],
        *,
        frame: Frame | None = None,
        camera: str | None = None,
        encoding: str | None = None,
        quality: int | None = None,
        form: str | None = None,
        bilevel: bool = False,
        stamp_ns: int | None = None,
        new_epoch: bool = False,
        compress: Compress | None = None,
    ) -> Published:
        """Publish a picture: a result, a camera's next frame, or a frame that has its identity.

        With ``frame`` it is a result made from that frame, with its identity, and not counted. A
        crop or another size than the frame's is sent with a header that says its size; a picture
        that is the frame's reduced keeps the frame's coordinates. It is made only if someone
        subscribes or queries.

        Without ``frame`` it is the next frame of a camera of this node, on ``image/compressed``:
        it gets an identity, counts as ``captured``, and then as ``published`` or dropped, as
        ``no_subscriber`` or under the name of what is wrong with it. It goes in shared memory,
        compressed and raw, each if someone asks for it. The newest parameters are activated for the
        next picture.

        A ``Frame`` is published under its own header, and counted if it was counted as captured.

        Args:
            topic: One that the node publishes. Of a result it says the form, JPEG or PNG.
            picture: Pixels (height, width[, channels]) uint8 or uint16; the bytes of a JPEG or PNG,
                which are published as they are; a ``Picture``; a ``Frame``; or, of a result, a
                function that makes one of the first three. The function is called at most once,
                perhaps later and on another thread, so what it uses must not change any more.
                Pixels that can be written to are copied, so their memory may be used again.
            frame: The frame from which a result was made.
            camera: The camera of a next frame, if the node has several.
            encoding: Of pixels: ``bgr8``, ``mono8``, ...; by default that of the channels and
                dtype, colour in the order B, G, R; of a PNG of 16 bits ``mono16``.
            quality: JPEG quality, 1 to 100, by default 80; for a next frame, a setting of the node
                with ``Role("quality")`` holds instead.
            form: Of a result: ``jpeg``, ``png``, ``raw``, ``bits`` or another that is registered,
                instead of the topic's.
            bilevel: All pixels are 0 or 255: a PNG then has one bit each.
            stamp_ns: Time of capture of a next frame, ns since 1970; by default now.
            new_epoch: The source was opened again, so the numbers of its frames begin again.
            compress: Makes the compressed bytes of a camera's frame when they are to be sent: a
                smaller picture of it perhaps, or None to withhold it.

        Returns:
            What became of it, and its frame.

        Raises:
            ValueError: The node does not publish the topic of the camera, there is no such form, or
                an argument is given that this kind of picture does not have.
            PayloadError: A result, or a frame that was not counted as captured, cannot be sent in
                the form.
        """
        given = {
            "frame": frame,
            "camera": camera,
            "encoding": encoding,
            "quality": quality,
            "form": form,
            "bilevel": bilevel or None,
            "stamp_ns": stamp_ns,
            "new_epoch": new_epoch or None,
            "compress": compress,
        }
        if isinstance(picture, Frame):
            what, allowed = "a frame that has its identity", ["compress"]
        elif frame is not None:
            what = "a result"
            allowed = ["frame", "encoding", "quality", "form", "bilevel"]
        elif topic_named(topic).name in (COMPRESSED.name, RAW.name) and not callable(picture):
            what = "the next frame of a camera"
            allowed = ["camera", "encoding", "quality", "stamp_ns", "new_epoch", "compress"]
        else:
            raise ValueError(
                f"{topic}: frame=None is for the next frame of a camera, which is a picture on "
                f"{COMPRESSED.name}; a result names the frame from which it was made"
            )
        for name, value in given.items():
            if value is not None and name not in allowed:  # it would have no effect
                raise ValueError(f"{name}= is not for {what}; allowed: {', '.join(allowed)}")
        if isinstance(picture, Frame):
            return self._outputs.publish_frame(topic, picture, compress)
        quality = QUALITY if quality is None else quality
        if frame is not None:
            return self._outputs.publish_result(
                topic,
                frame,
                picture,
                encoding=encoding,
                quality=quality,
                form=form,
                bilevel=bilevel,
            )
        assert not callable(picture)
        return self._outputs.publish_own(
            picture,
            camera=camera,
            encoding=encoding,
            quality=quality,
            stamp_ns=stamp_ns,
            new_epoch=new_epoch,
            compress=compress,
        )

    def publish_bytes(
        self,
        topic: Topic | str,
        payload: bytes,
        *,
        encoding: str,
        attachment: bytes | None = None,
        camera: str | None = None,
    ) -> bool:
        """Publish a payload with its attachment as it is, such as one that was recorded.

        Args:
            topic: One that the node publishes.
            payload: The bytes.
            encoding: Zenoh encoding.
            attachment: Bytes of the header; None sends none.
            camera: If the node has several.

        Returns:
            Whether it was sent; else it is kept for queries.

        Raises:
            ValueError: The node does not publish the topic of the camera.
        """
        return self._outputs.publish_bytes(topic, payload, encoding, attachment, camera)

    def add_stream(self, key: str, topic: Topic) -> StreamPublisher:
        """Declare a key of any name, whose payloads and attachments are given as bytes.

        Args:
            key: The full key, which need not be that of a camera of this node.
            topic: Says how its samples are delivered, and how many answer queries.

        Returns:
            What publishes them.

        Raises:
            RuntimeError: The node is not open.
        """
        return self._outputs.add_stream(key, topic)

    def limit_replies(self, topic: Topic | str, camera: str, limit: ReplyLimit) -> None:
        """Have a function asked before each reply to a query on a topic.

        Args:
            topic: One that the node publishes.
            camera: Its camera.
            limit: Returns why a reply of this many bytes must not be sent now, which is then the
                error that is replied; None if it may be sent. Called on the thread of queries.

        Raises:
            ValueError: The node does not publish the topic of the camera.
        """
        self._outputs.limit_replies(topic, camera, limit)

    def answer(
        self,
        topic: Topic | str,
        reply_to: Callable[[Mapping[str, str]], Message],
        *,
        camera: str | None = None,
    ) -> None:
        """Answer the queries on a topic that is never published, until the node closes.

        Args:
            topic: One of those that the node publishes, with ``by_query``.
            reply_to: Called with the parameters of each query, one after the other, on the thread
                for queries. A ``ParameterRefused`` that it raises is sent as an error.
            camera: As for ``frames``.

        Raises:
            RuntimeError: The node is not open.
            ValueError: The table has no topic of this name, or it is published.
        """
        self._queries.answer(topic, reply_to, camera=camera)
