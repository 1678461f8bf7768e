"""Runs a service on given frames as fast as it goes: a router, the service, and its answers."""

from __future__ import annotations

import logging
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack
from typing import Final, Self

import msgpack
import zenoh

from zenoh_vision import keys
from zenoh_vision.errors import ExpectationNotMet, ParameterRefused, PayloadError
from zenoh_vision.host.wakeup import Wakeup
from zenoh_vision.messages import NodeDescription, ParameterList
from zenoh_vision.node.lockstep import FrameId, answer_keys
from zenoh_vision.topics import is_frame_key
from zenoh_vision.transport.publisher import MESSAGE_DELIVERY
from zenoh_vision.transport.query import Query, ask, messages_in
from zenoh_vision.transport.router import private_router
from zenoh_vision.transport.session import direct
from zv.bag.private_system import Child
from zv.bag.record import Record
from zv.bag.samples import record_of
from zv.tools.bag.answered import frame_id

log = logging.getLogger(__name__)

START_S: Final = 30.0
POLL_S: Final = 0.05
LOOK_S: Final = 1.0
ANSWER_S: Final = 30.0
HOLD_S: Final = 1.0
LATE_S: Final = 0.5
"""How long after the last frame a message may come that was not recorded."""


class ServiceRun:
    """A service that gets frames one by one, and what it says of them; opened by ``with``.

    Args:
        command: Starts the service; ``ZV_CONNECT`` and ``ZV_NAMESPACE`` are set for it.
        node: The name of its node.
        namespace: First chunk of the keys.
        cameras: Whose frames it will get.
        stopping: Whether to give up.
        answers: Keys that are collected; by default those of its messages, or of its pictures.
        answer_s: How long it may take for one frame.
    """

    def __init__(
        self,
        command: Sequence[str],
        node: str,
        namespace: str,
        cameras: Collection[str],
        stopping: Callable[[], bool] = lambda: False,
        *,
        answers: Collection[str] = (),
        answer_s: float = ANSWER_S,
    ) -> None:
        self.node = node
        self._received: deque[Record] = deque()
        self._said: dict[FrameId, list[Record]] = {}  # by frame, until they are taken
        self._unexpected: list[Record] = []
        self._command = list(command)
        self._namespace = namespace
        self._cameras = set(cameras)
        self._stopping = stopping
        self._answers = set(answers)
        self._answer_s = answer_s
        self._arrived = Wakeup()
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._newest: dict[str, Record] = {}  # by key
        self._open = ExitStack()

    def __enter__(self) -> Self:
        """Start router and service, and wait until the service takes frames.

        Raises:
            ExpectationNotMet: It does not start, or takes no frames of the cameras.
        """
        with ExitStack() as opening:
            self._session, endpoint = opening.enter_context(private_router())
            child = Child(self._command, endpoint, self._namespace)
            self._child = opening.enter_context(child)
            self.about = self._wait_until_ready()
            for key in sorted(self._answers or answer_keys(self.about.publishes)):
                opening.callback(
                    self._session.declare_subscriber(key, direct(self._receive)).undeclare
                )
            self._open = opening.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def parameters(self) -> ParameterList | None:
        """Return the service's parameters; None if it has none."""
        key = keys.parameters_key(self._namespace, self.node)
        (replies,) = ask(self._session, [Query(key)], self._stopping)
        return next((found for _, found in messages_in(replies, ParameterList)), None)

    def set(self, values: Mapping[str, object]) -> None:
        """Change parameters; the next frame is processed with them.

        Raises:
            ExpectationNotMet: It does not answer, or refuses them.
        """
        query = Query(keys.set_key(self._namespace, self.node), msgpack.packb(dict(values)))
        (replies,) = ask(self._session, [query], self._stopping)
        if not replies:
            raise ExpectationNotMet(f"{self.node} has not answered a change of {', '.join(values)}")
        try:
            replies[0].message(ParameterList)
        except (ParameterRefused, PayloadError) as error:
            raise ExpectationNotMet(f"{self.node} refuses {dict(values)}: {error}") from None

    def send(self, record: Record) -> None:
        """Send a record that is no frame, such as a calibration; queries get the newest."""
        if record.key not in self._newest:  # a tracker asks for it at its first frame
            queryable = self._session.declare_queryable(record.key, direct(self._reply))
            self._open.callback(queryable.undeclare)
        self._newest[record.key] = record
        self._put(record)

    def send_frame(
        self,
        frame: Record,
        expected: Counter[str] | None = None,
        results: Iterable[Record] = (),
        later: Iterable[Record] = (),
    ) -> None:
        """Send a frame, and wait until the service has said something of it, or its time is over.

        Args:
            frame: With a header.
            expected: How many messages of each key to wait for; by default one of any key.
            results: What other nodes said of the frame, sent before the wait.
            later: What they said of it after the service had answered, sent after the wait; or
                after ``HOLD_S`` without an answer, which may depend on it.

        Raises:
            ExpectationNotMet: It has ended.
        """
        sent = frame_id(frame)
        assert sent is not None
        found = self._said.setdefault(sent, [])
        began_s = looked_s = time.monotonic()
        self._put(frame)
        for each in results:
            self.send(each)
        held = [*later]

        def complete() -> bool:
            self._sort()
            if expected is None:
                return bool(found)
            return not expected - Counter(each.key for each in found)

        while not self._arrived.wait_for(complete, POLL_S):
            now_s = time.monotonic()
            if self._stopping() or now_s - began_s > self._answer_s:
                break
            while held and now_s - began_s > HOLD_S:
                self.send(held.pop(0))
            if found and now_s - began_s > LATE_S + self._answer_s / 10:
                break  # it has answered, but not with all
            if now_s - looked_s > LOOK_S:
                looked_s = now_s
                self._check_running()
        for each in held:
            self.send(each)

    def take_answers(self, frame: Record) -> list[Record]:
        """Return, once, what the service has said so far of a frame that was sent."""
        self._sort()
        sent = frame_id(frame)
        return [] if sent is None else self._said.pop(sent, [])

    def wait_for_late_ones(self) -> None:
        """Wait a moment for messages that were not expected, after the last frame."""
        time.sleep(LATE_S)

    def unexpected(self) -> list[Record]:
        """Return, once, the messages of no frame whose answers are still to be taken."""
        self._sort()
        found, self._unexpected = self._unexpected, []
        return found

    def _sort(self) -> None:
        """Put what has arrived to its frames."""
        while self._received:
            record = self._received.popleft()
            of = frame_id(record)
            known = None if of is None else self._said.get(of)
            (self._unexpected if known is None else known).append(record)

    def _check_running(self) -> None:
        status = self._child.status
        if status is not None:
            said = self._child.said()
            raise ExpectationNotMet(f"{self.node} ended with status {status}: {said}")

    def _wait_until_ready(self) -> NodeDescription:
        until_s = time.monotonic() + START_S
        key = keys.node_key(self._namespace, "*")
        while not self._stopping():
            self._check_running()
            (replies,) = ask(self._session, [Query(key)], self._stopping)
            found = {about.node: about for _, about in messages_in(replies, NodeDescription)}
            about = found.get(self.node)
            if about is not None and any(map(is_frame_key, about.subscribes)):
                return about
            if time.monotonic() > until_s:
                there = ", ".join(sorted(found)) or "none"
                raise ExpectationNotMet(
                    f"{self.node} takes no frames within {START_S:g} s; nodes that run: {there}"
                )
            time.sleep(POLL_S)
        raise ExpectationNotMet(f"told to stop before {self.node} was ready")

    def _receive(self, sample: zenoh.Sample) -> None:
        record = record_of(sample, time.time_ns())
        if record.header.get("node") == self.node:
            self._received.append(record)
            self._arrived.set()

    def _reply(self, query: zenoh.Query) -> None:
        record = self._newest.get(str(query.key_expr))
        if record is not None:
            query.reply(
                record.key, record.payload, encoding=record.encoding, attachment=record.attachment
            )

    def _put(self, record: Record) -> None:
        publisher = self._publishers.get(record.key)
        if publisher is None:
            control, priority = MESSAGE_DELIVERY
            publisher = self._publishers[record.key] = self._session.declare_publisher(
                record.key, congestion_control=control, priority=priority
            )
            self._wait_for_subscriber(publisher)
        publisher.put(record.payload, encoding=record.encoding, attachment=record.attachment)

    def _wait_for_subscriber(self, publisher: zenoh.Publisher) -> None:
        """Wait until the service's subscription is known here; a calibration may have none."""
        until_s = time.monotonic() + (START_S if is_frame_key(str(publisher.key_expr)) else LATE_S)
        while not publisher.matching_status.matching and time.monotonic() < until_s:  # type: ignore[attr-defined]
            if self._stopping():
                return
            time.sleep(0.005)


def marked(frame: Record, begun_ns: int) -> Record:
    """Return a frame that says that it is replayed now, so that it is not stale."""
    header = frame.header | {"replay": begun_ns, "replayed_ns": time.time_ns(), "lockstep": True}
    return Record(frame.key, frame.payload, frame.encoding, msgpack.packb(header))
