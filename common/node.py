"""``Node``: the life of a process on the network, so that a service is only a loop.

```python
with Node("brightness", camera="front", publishes=[BRIGHTNESS]) as node:
    for frame in node.frames("image", want="gray"):
        node.publish(BRIGHTNESS, Brightness(header=node.header(frame), mean=frame.gray.mean()))
```

The iterator ends at SIGINT or SIGTERM, and so does the ``with``.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Any, Self

import zenoh

from common import keys, parameter_server
from common.codec import Message
from common.connection import Connection
from common.description import description
from common.errors import ConfigurationError, PayloadError
from common.frame import Form, Frame
from common.health import Health
from common.heartbeat import Heartbeat
from common.images import Pixels
from common.keys import Topic
from common.ledger import Ledger
from common.live import LiveSettings
from common.messages import Diagnostics, Header, NodeDescription, Stamped
from common.parameter_server import ParameterServer
from common.publishing import Sample, StreamPublisher, picture_sample
from common.receiving import FrameReceiver
from common.serving import QueryServer, answer_schemas
from common.session import close_session, open_session
from common.signals import StopSignals

POLL_S = 0.1


class Node:
    """A node of the system: opened by ``with``, stopped by a signal or ``stop()``.

    Args:
        service: Kind of node: ``tracker``.
        camera: The camera it serves; its name is then ``{service}_{camera}``. Several or none:
            a tuple of them, and its name is ``{service}``.
        connection: Where the router is.
        publishes: Topics it publishes, rows of the table or their names.
        messages: Message classes it sends, for schema queries.
        counts: Names of what comes in and what was dealt with, in its counters.
        parameters: Its live settings. They answer and are published under its name, the
            newest revision is in force from one frame of ``frames`` to the next, and its number
            stands in the headers that the node makes.

    Attributes:
        listens: Says which keys it subscribes to besides those of its frames.
    """

    def __init__(
        self,
        service: str,
        *,
        camera: str | tuple[str, ...] = keys.DEFAULT_CAMERA,
        connection: Connection | None = None,
        publishes: Sequence[Topic | str] = (),
        messages: Sequence[type[Message]] = (),
        counts: tuple[str, str] = ("received", "processed"),
        parameters: LiveSettings[Any] | None = None,
    ) -> None:
        self.connection = connection or Connection()
        self.cameras = (camera,) if isinstance(camera, str) else camera
        for name in (service, *self.cameras, self.connection.namespace):
            if not keys.is_name(name):
                raise ConfigurationError(f"{name!r} is no name: allowed are a-z, 0-9 and _")
        self.service = service
        self.name = f"{service}_{camera}" if isinstance(camera, str) else service
        self.listens: Callable[[], Sequence[str]] = tuple
        self.parameters = parameters
        self.ledger = Ledger(*counts)
        self.health = Health(self.name, self.ledger)
        self._topics = [keys.TOPICS[t] if isinstance(t, str) else t for t in publishes]
        self._messages: set[type[Message]] = {Diagnostics, NodeDescription, *messages}
        if parameters is not None:
            self._messages.update(parameter_server.MESSAGES)
        self._publishers: dict[tuple[str, str], StreamPublisher] = {}
        self._stopping = False
        self._started_ns = time.time_ns()
        self._heartbeat = Heartbeat()
        self._signals = StopSignals(self.stop)

    # Life

    def __enter__(self) -> Self:
        """Open the session, waiting for the router; declare what the node offers."""
        self._signals.catch()
        try:
            self._session = open_session(self.connection, self._waiting_is_over)
        except BaseException:
            self._signals.release()
            raise
        self._server = QueryServer(self._say_how_it_does)
        namespace = self.connection.namespace
        for topic, camera in itertools.product(self._topics, self.cameras):
            self._publishers[topic.name, camera] = StreamPublisher(
                self._session, topic, topic.key(namespace, camera), self._server.ask
            )
        self._diagnostics = StreamPublisher(
            self._session,
            keys.message_topic("diagnostics", Diagnostics.schema_name),
            keys.diagnostics_key(namespace, self.name),
            self._server.ask,
        )
        own_key = keys.node_key(namespace, self.name)
        self._server.declare(self._session, own_key, self._describe)
        self._server.declare(
            self._session,
            keys.schema_key(namespace, "*"),
            answer_schemas(namespace, self._messages),
        )
        if self.parameters is not None:
            answers = ParameterServer(self.parameters, namespace, self.name)
            answers.publish_to(self._session)
            self._server.declare(self._session, answers.key, answers.answer)
        self._token = self._session.liveliness().declare_token(own_key)
        self._server.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Say goodbye and close the session, in bounded time whatever the router does."""
        self._stopping = True
        self._server.close()
        close_session(self._session)
        self._signals.release()

    @property
    def revision(self) -> int:
        """Number of the revision of its parameters that is in force; 0 without parameters."""
        return 0 if self.parameters is None else self.parameters.in_force.number

    @property
    def camera(self) -> str:
        """The one camera that it serves."""
        return self._camera(None)

    @property
    def session(self) -> zenoh.Session:
        """Its Zenoh session, for what a service does besides; open inside the ``with``."""
        return self._session

    @property
    def stopping(self) -> bool:
        """Whether the node was told to stop."""
        return self._stopping

    def stop(self) -> None:
        """End the iterators; safe in a signal handler and from any thread."""
        self._stopping = True

    def _waiting_is_over(self) -> bool:
        """Tell whether to give up on the router; to wait for it is to be well."""
        self._heartbeat.beat()
        return self._stopping

    # Frames in

    def frames(
        self,
        topic: Topic | str = "image",
        *,
        want: Form = "bgr",
        max_age_s: float | Callable[[], float] = 0.4,
        camera: str | None = None,
    ) -> Iterator[Frame]:
        """Yield a camera's newest frames, each decodable, none twice, none stale.

        Ends when the node is told to stop. What the loop does with a frame is timed and
        counted as processed when it asks for the next.

        Args:
            topic: ``image`` or ``raw``, or another topic that carries pictures.
            want: The form that is decoded beforehand, so that its errors are counted here.
            max_age_s: Older ones, over the best recently seen, are dropped as ``stale``; or
                what says how old they may be now.
            camera: Whose, if the node serves several.
        """
        whose = self._camera(camera)
        row = keys.TOPICS[topic] if isinstance(topic, str) else topic

        def begin() -> float:
            """Let the newest parameters be in force for the frame that is being taken."""
            if self.parameters is not None:
                self.parameters.take()
            return max_age_s() if callable(max_age_s) else max_age_s

        receiver = FrameReceiver(
            self._session,
            row.key(self.connection.namespace, whose),
            camera=whose,
            raw=row.encoding == keys.RAW_IMAGE,
            max_age_s=begin,
            ledger=self.ledger,
            complain=self.health.complain,
        )
        self.health.receivers.append(receiver)
        try:
            while not self._stopping:
                self.health.turn()
                frame = receiver.take(POLL_S, want)
                if frame is None:
                    continue
                try:
                    yield frame
                finally:
                    self.done(frame.header.stamp_ns)
        finally:
            self.health.receivers.remove(receiver)
            receiver.close()

    def done(self, stamp_ns: int) -> None:
        """Count one pending frame as dealt with."""
        self.ledger.finish()
        self.health.pace.note(time.monotonic(), (time.time_ns() - stamp_ns) / 1e6)

    def dropped(self, error: PayloadError) -> None:
        """Count one pending frame as dropped, and say so once per burst."""
        self.ledger.drop(error.reason)
        self.health.complain(error)

    # Results out

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

    # Health and description

    def _say_how_it_does(self) -> None:
        self._heartbeat.beat(self.health.trouble())
        diagnostics = self.health.diagnostics()
        self._diagnostics.offer(
            lambda: Sample(diagnostics.to_bytes(), self._diagnostics.topic.encoding, None)
        )

    def _describe(self, query: zenoh.Query) -> None:
        own = description(
            self.name,
            self.service,
            self.cameras,
            started_ns=self._started_ns,
            publishes=[publisher.key for publisher in self._publishers.values()],
            subscribes=[*(receiver.key for receiver in self.health.receivers), *self.listens()],
            rate_hz=self.health.bounds.expected_hz,
        )
        query.reply(
            keys.node_key(self.connection.namespace, self.name),
            own.to_bytes(),
            encoding=keys.msgpack_of(NodeDescription.schema_name),
        )
