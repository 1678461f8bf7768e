"""``Node``: manages everything of a process on the network except a service's loop.

```python
with Node("brightness", camera="front", publishes=[BRIGHTNESS]) as node:
    for frame in node.frames("image/compressed", want="gray"):
        node.publish(BRIGHTNESS, Brightness(header=node.header(frame), mean=frame.gray.mean()))
```

The iteration ends at SIGINT or SIGTERM, and so does the ``with``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from typing import Any, Literal, Self, TypeVar, overload

from zenoh_vision import keys
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.config.settings import Settings
from zenoh_vision.errors import ConfigurationError, PayloadError
from zenoh_vision.health.health import Health
from zenoh_vision.host.signals import StopSignals
from zenoh_vision.image.frame import Frame, Want
from zenoh_vision.image.pixel_formats import MAX_PIXELS
from zenoh_vision.keys import Transport
from zenoh_vision.message_codec import Message
from zenoh_vision.node.announcement import Announcement
from zenoh_vision.node.frame_input import MAX_AGE_S, frame_input
from zenoh_vision.node.inputs import Input, merged
from zenoh_vision.node.outputs import Outputs, Publishes
from zenoh_vision.node.own_frames import OwnFrames
from zenoh_vision.node.pairs import DEPTH, TOLERANCE_S, WAIT_S, paired
from zenoh_vision.node.queries import Queries
from zenoh_vision.node.rate import ticks
from zenoh_vision.stream.buffer import Buffering, latest, queue
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.intake import Consumer, MessageIntake, SampleIntake
from zenoh_vision.stream.sample import Sample
from zenoh_vision.topics import COMPRESSED, RAW, TOPICS, Topic, topic_named
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.link import Link

COUNTS = ("received", "processed")
CAMERA_COUNTS = ("captured", "published")

A = TypeVar("A")
B = TypeVar("B")


class Node:
    """A node of the system: opened by ``with``, stopped by a signal or ``stop()``.

    Args:
        service: Kind of node: ``tracker``.
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

    Attributes:
        stopping: Whether a stop was requested.
        inputs: Its open inputs.
        publish, publish_picture, header: Those of its ``Outputs``.
        publish_frame, publish_captured: Those of its ``OwnFrames``.
        answer: That of its ``Queries``.

    Raises:
        ConfigurationError: A name has other characters than a-z, 0-9 and _.
    """

    def __init__(
        self,
        service: str,
        *,
        camera: str | tuple[str, ...] = keys.DEFAULT_CAMERA,
        connection: Connection | None = None,
        publishes: Publishes = (),
        counts: tuple[str, str] | None = None,
        parameters: ParameterStore[Any] | Settings | None = None,
    ) -> None:
        self.connection = connection or Connection()
        self.cameras = (camera,) if isinstance(camera, str) else camera
        for name in (service, *self.cameras, self.connection.namespace):
            if not keys.is_name(name):
                raise ConfigurationError(f"{name!r} is no name: allowed are a-z, 0-9 and _")
        self.service = service
        self.name = f"{service}_{camera}" if isinstance(camera, str) else service
        if isinstance(parameters, Settings):
            parameters = ParameterStore(parameters)
        self.parameters = parameters
        self.outputs = Outputs(self.name, self.cameras, publishes)
        is_camera = {COMPRESSED, RAW} & set(self.outputs.topics)
        self.counters = FrameCounters(*counts or (CAMERA_COUNTS if is_camera else COUNTS))
        self.health = Health(self.name, self.counters)
        self.consumer = Consumer(self.counters, self.health.log_drop)
        self.own_frames = OwnFrames(self, self._camera)
        self.publish = self.outputs.publish
        self.publish_picture = self.outputs.publish_picture
        self.publish_frame = self.own_frames.publish_frame
        self.publish_captured = self.own_frames.publish_captured
        self.header = self.outputs.header
        self._queries = Queries(self, self._camera)
        self.answer = self._queries.answer
        self._announcement = Announcement(self)
        self.inputs: set[Input[Any]] = set()
        self.stopping = False
        self._link: Link | None = None
        self._open = ExitStack()

    # Life

    def __enter__(self) -> Self:
        """Open the session, waiting for the router; declare what the node offers.

        Raises:
            RouterUnreachable: No router within the connection's time, if it has one.
            ToldToStop: Told to stop before there was one.
        """
        with ExitStack() as opening:
            signals = StopSignals(self.stop)
            signals.catch()
            opening.callback(signals.release)
            self._link = Link(self.connection, self._give_up_waiting, lambda: self.stopping)
            opening.callback(self._link.close)
            opening.callback(self.outputs.close)
            namespace, server = self.connection.namespace, self._queries.server
            self.outputs.declare(self._link, namespace, server)
            self._announcement.declare(self._link, namespace, server)
            self._queries.declare(self._link)
            server.start()
            opening.callback(server.close)
            self._announcement.start()
            opening.callback(self._announcement.close)
            opening.callback(self._close_inputs)
            self._open = opening.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        """Send the last diagnostics and close the session, in bounded time."""
        self.stopping = True
        self._open.close()

    def _close_inputs(self) -> None:
        with ExitStack() as closing:
            for each in tuple(self.inputs):
                closing.callback(each.close)

    @property
    def camera(self) -> str:
        """The camera that the node serves, if it serves only one."""
        return self._camera(None)

    @property
    def link(self) -> Link:
        """Its link to the router, inside the ``with``, for declarations and queries of your own."""
        if self._link is None:
            raise RuntimeError(f"{self.name} is not open: use it inside `with`")
        return self._link

    def stop(self) -> None:
        """End the iterations; safe in a signal handler and from any thread."""
        self.stopping = True

    def _give_up_waiting(self) -> bool:
        self._announcement.beat()
        return self.stopping

    # Inputs

    def frames(
        self,
        topic: Topic | str = COMPRESSED,
        *,
        camera: str | None = None,
        want: Want = "bgr",
        max_age_s: float | None = MAX_AGE_S,
        buffering: Buffering = latest,
        borrow: bool = False,
        max_pixels: int = MAX_PIXELS,
        transport: Transport | None = None,
    ) -> Input[Frame]:
        """Return an iterable of frames, without damaged, duplicate and stale ones.

        A frame that waits in a queue for longer than ``max_age_s`` is stale: a consumer that
        needs every frame passes ``buffering=queue(n), max_age_s=None``.

        Args:
            topic: ``image/compressed`` or ``image``, or another topic that carries pictures.
            camera: The camera, if the node serves several; ``*`` for all.
            want: The form that is decoded beforehand, so that its errors are counted here; or a
                function that decodes what the loop needs of a frame, such as a reduced size.
            max_age_s: Frames that are more than this later than the fastest of the last minute are
                dropped as ``stale``. If the node has a setting ``max_age``, that holds instead.
                None drops none, whatever the settings.
            buffering: ``latest``, or ``queue(n)`` for frames in order of arrival.
            borrow: Frames may be views of memory that the transport lends, valid until the next
                is asked for; ``Frame.keep`` copies one.
            max_pixels: Larger frames are dropped as ``too_large`` before they are decoded.
            transport: ``auto``: the camera's frames in shared memory if both are on one machine and
                have the extra ``shm``, else the compressed ones if they are published, else the raw
                pixels; ``shm``, ``jpeg`` or ``raw``: only these. If the node has a setting
                ``transport``, that holds instead. It needs the topic ``image/compressed`` of one
                camera. None: ``ZV_TRANSPORT`` of the environment, or else ``auto``, for that topic
                of one camera without a queue; for any other input, its topic over the network.

        Raises:
            TypeError: ``buffering`` is neither ``latest`` nor a ``queue(n)``.
            ValueError: The node does not serve the camera, the topic carries no pictures, there is
                no such form or transport, or the transport does not fit the topic.
            ConfigurationError: The transport is ``shm``, which this process cannot use.
        """
        return frame_input(
            self,
            topic_named(topic),
            self._camera(camera),
            want=want,
            max_age_s=max_age_s,
            buffering=buffering,
            borrow=borrow,
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
            key = row.key(self.connection.namespace, self._camera(camera))
            message = row.message
            if message is None and row.name in TOPICS:
                raise ValueError(f"{row.name} carries pictures, not messages; take node.frames")
        else:
            key = topic
        intake = MessageIntake(key, self.consumer, buffering, message=message)
        return Input(self, intake, intake.take)

    def samples(
        self,
        key: str,
        *,
        buffering: Buffering = queue(1000),  # noqa: B008 - a frozen value
    ) -> Input[Sample]:
        """Return an iterable of the samples on a key expression (``vision/**``), unchecked.

        A deletion is a sample too: its ``deleted`` is set.
        """
        intake = SampleIntake(key, self.consumer, buffering)
        return Input(self, intake, intake.take)

    def receive(self, *inputs: Input[Any]) -> Iterator[Any]:
        """Yield the items of several inputs in one loop, until the node is told to stop."""
        return merged(self, inputs)

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
            self,
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
        return ticks(self, rate_hz)

    def add_camera(self, name: str, publishes: Sequence[Topic | str] = ()) -> None:
        """Serve one more camera, such as one whose first frame arrived on an input of all cameras.

        Its topics are declared, and the node's description names it from now on.

        Raises:
            ConfigurationError: The name has other characters than a-z, 0-9 and _.
            ValueError: The table has no topic of a name.
        """
        if not keys.is_name(name):
            raise ConfigurationError(f"{name!r} is no name: allowed are a-z, 0-9 and _")
        if name not in self.cameras:
            self.outputs.add_camera(name, publishes)
            self.cameras = (*self.cameras, name)

    def drop(self, error: PayloadError) -> None:
        """Count one pending frame as dropped, and log it once per burst."""
        self.counters.drop(error.reason)
        self.health.log_drop(error)

    def _camera(self, camera: str | None) -> str:
        """Return the camera that an argument selects: the only one, one of several, or ``*``."""
        if camera == "*":
            return camera
        if camera is None and len(self.cameras) == 1:
            return self.cameras[0]
        if camera not in self.cameras:
            raise ValueError(f"{self.name} serves {self.cameras or 'no camera'}, not {camera!r}")
        return camera
