"""``Core``: the state that the parts of a node share."""

from __future__ import annotations

import threading
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from zenoh_vision.config.revisions import ParameterStore, Revision
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.health import Health
from zenoh_vision.host.clock import Clock
from zenoh_vision.stream.counters import FrameCounters
from zenoh_vision.stream.intake import Consumer
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.link import Link

if TYPE_CHECKING:
    from zenoh_vision.node.inputs import Input


@dataclass(slots=True)
class Core:
    """Who a node is, what it counts, its open inputs, and its link to the router."""

    name: str
    service: str
    cameras: tuple[str, ...]
    connection: Connection
    counters: FrameCounters
    health: Health
    parameters: ParameterStore[Any] | None
    clock: Clock
    consumer: Consumer = field(init=False)
    inputs: set[Input[Any]] = field(default_factory=set)
    dropped: Counter[int] = field(default_factory=Counter)  # by thread, see ``take_dropped``
    stopping: bool = False
    opened_link: Link | None = None

    def __post_init__(self) -> None:
        """Make what the inputs share."""
        self.consumer = Consumer(self.counters, self.health.log_drop, clock=self.clock)

    @property
    def namespace(self) -> str:
        """First chunk of the keys."""
        return self.connection.namespace

    @property
    def link(self) -> Link:
        """The link to the router.

        Raises:
            RuntimeError: The node is not open.
        """
        if self.opened_link is None:
            raise self.not_open()
        return self.opened_link

    def not_open(self) -> RuntimeError:
        """Return the error of a node that is used before it is open."""
        return RuntimeError(f"{self.name} is not open: use it inside `with`")

    @property
    def revision(self) -> Revision[Any] | None:
        """The active revision of the parameters; None without parameters."""
        return None if self.parameters is None else self.parameters.active

    def activate(self) -> Revision[Any] | None:
        """Make the newest revision of the parameters the active one, between two items."""
        return None if self.parameters is None else self.parameters.activate()

    def drop(self, error: PayloadError) -> None:
        """Count one pending item as dropped, and log it once per burst."""
        self.counters.drop(error.reason)
        self.health.log_drop(error)

    def drop_in_work(self, error: PayloadError) -> None:
        """Count as dropped, not as done, an item that a loop on this thread has handed out."""
        self.dropped[threading.get_ident()] += 1
        self.drop(error)

    def take_dropped(self) -> int:
        """Return how many items this thread has dropped since the last call."""
        return self.dropped.pop(threading.get_ident(), 0)

    def camera(self, named: str | None) -> str:
        """Return the camera that an argument selects: the only one, one of several, or ``*``.

        Raises:
            ValueError: The node does not serve it, or serves several and none is named.
        """
        if named == "*":
            return named
        if named is None and len(self.cameras) == 1:
            return self.cameras[0]
        if named is None and self.cameras:
            raise ValueError(f"{self.name} serves {self.cameras}: name the camera")
        if named not in self.cameras:
            raise ValueError(f"{self.name} serves {self.cameras or 'no camera'}, not {named!r}")
        return named
