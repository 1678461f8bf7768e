"""``Node``: the life of a process on the network, so that a service is only a loop.

```python
with Node("brightness", camera="front", publishes=[BRIGHTNESS]) as node:
    for frame in node.frames("image", want="gray"):
        node.publish(BRIGHTNESS, Brightness(header=node.header(frame), mean=frame.gray.mean()))
```

The iterator ends at SIGINT or SIGTERM, and so does the ``with``.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Any, Self

from common import keys, parameter_server
from common.codec import Message
from common.connection import Connection
from common.errors import ConfigurationError, PayloadError
from common.frame import Form, Frame
from common.health import Health
from common.keys import Topic
from common.ledger import Ledger
from common.link import Link
from common.live import LiveSettings
from common.messages import Diagnostics, NodeDescription
from common.parameter_server import ParameterServer
from common.receiving import FrameReceiver
from common.results import Results
from common.self_report import SelfReport
from common.serving import QueryServer, answer_schemas
from common.signals import StopSignals

POLL_S = 0.1


class Node(Results):
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
        name = f"{service}_{camera}" if isinstance(camera, str) else service
        super().__init__(name, self.cameras, publishes)
        self.listens: Callable[[], Sequence[str]] = tuple
        self.parameters = parameters
        self.ledger = Ledger(*counts)
        self.health = Health(self.name, self.ledger)
        self._messages: set[type[Message]] = {Diagnostics, NodeDescription, *messages}
        if parameters is not None:
            self._messages.update(parameter_server.MESSAGES)
        self._stopping = False
        self._report = SelfReport(
            self.name,
            service,
            self.cameras,
            self.health,
            publishes=lambda: self.published_keys,
            listens=lambda: self.listens(),
        )
        self._signals = StopSignals(self.stop)

    # Life

    def __enter__(self) -> Self:
        """Open the session, waiting for the router; declare what the node offers."""
        self._signals.catch()
        try:
            self._link = Link(self.connection, self._waiting_is_over, lambda: self._stopping)
        except BaseException:
            self._signals.release()
            raise
        self._server = QueryServer(self._report.send)
        namespace = self.connection.namespace
        self._declare_publishers(self._link, namespace, self._server)
        self._report.declare(self._link, namespace, self._server)
        self._server.declare(
            self._link,
            keys.schema_key(namespace, "*"),
            answer_schemas(namespace, self._messages),
        )
        if self.parameters is not None:
            answers = ParameterServer(self.parameters, namespace, self.name)
            answers.publish_to(self._link)
            self._server.declare(self._link, answers.key, answers.answer)
        self._report.show()
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
        self._link.close()
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
    def link(self) -> Link:
        """Its link to the router, for what a service declares, puts and asks besides.

        Open inside the ``with``.
        """
        return self._link

    @property
    def stopping(self) -> bool:
        """Whether the node was told to stop."""
        return self._stopping

    def stop(self) -> None:
        """End the iterators; safe in a signal handler and from any thread."""
        self._stopping = True

    def _waiting_is_over(self) -> bool:
        """Tell whether to give up on the router; to wait for it is to be well."""
        self._report.waiting()
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
            self._link,
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
