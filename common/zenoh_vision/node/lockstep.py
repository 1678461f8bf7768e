"""Waits until named nodes have answered a frame, so that none is dropped however slow they are.

A node answers a frame with the messages, or else the pictures, that carry the frame's identity.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

import zenoh

from zenoh_vision import keys
from zenoh_vision.errors import ExpectationNotMet, PayloadError
from zenoh_vision.host.wakeup import Wakeup
from zenoh_vision.messages import Header, NodeDescription
from zenoh_vision.topics import is_frame_key, topic_of
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.matching import intersect
from zenoh_vision.transport.query import Query, ask, messages_in
from zenoh_vision.transport.session import direct

log = logging.getLogger("lockstep")

ASK_S = 0.05
"""How often a node is asked for its description until it has its inputs."""

LOOK_S = 0.5
"""How often it is looked whether a node that does not answer still runs."""

TELL_S = 2.0
"""After this time it is said for which node one waits."""

POLL_S = 0.1
ANSWER_S = 30.0

MOST_ANSWERED = 64
"""Frames of a camera whose answers are remembered until the next wait."""

FrameId = tuple[str, int, int]
"""Camera, epoch and seq."""


@dataclass(slots=True)
class Follower:
    """A node that answers frames.

    Attributes:
        cameras: Those whose frames it takes.
        subscribes: The key expressions that it subscribed to when it was found.
        answered: By camera, the frames that it has answered since the last wait; more than one,
            since it may say more of an earlier frame after its answer.
    """

    name: str
    cameras: frozenset[str]
    subscribes: tuple[str, ...] = ()
    answered: dict[str, deque[FrameId]] = field(default_factory=dict)

    def has_answered(self, frame: FrameId) -> bool:
        """Tell whether it has answered a frame since the last wait for that camera's frames."""
        return frame in self.answered.get(frame[0], ())

    def note(self, answer: FrameId) -> None:
        """Note the frame of a message that it has sent."""
        found = self.answered.setdefault(answer[0], deque(maxlen=MOST_ANSWERED))
        if answer not in found:
            found.append(answer)


class Lockstep:
    """Follows nodes by what they publish.

    A node may take ``answer_s`` for one frame; ``stopping`` tells whether to give up.
    """

    def __init__(
        self,
        link: Link,
        namespace: str,
        nodes: Sequence[str],
        stopping: Callable[[], bool] = lambda: False,
        *,
        answer_s: float = ANSWER_S,
    ) -> None:
        self._link = link
        self._namespace = namespace
        self._names = tuple(dict.fromkeys(nodes))
        self._stopping = stopping
        self._answer_s = answer_s
        self._arrived = Wakeup()
        self._followers: dict[str, Follower] = {}
        self._declared: list[Declaration[zenoh.Subscriber[None]]] = []

    def takes(self, key: str) -> bool:
        """Tell whether one of the nodes subscribed to a key when it was found."""
        return any(
            intersect(expression, key)
            for each in self._followers.values()
            for expression in each.subscribes
        )

    def close(self) -> None:
        """End the subscriptions."""
        for each in self._declared:
            each.undeclare()
        self._declared.clear()

    def find(self, cameras: Collection[str], timeout_s: float | None) -> None:
        """Wait until all nodes run and take frames, then follow them.

        Without ``timeout_s`` it waits until told to stop.

        Raises:
            ExpectationNotMet: A node does not run, or takes no frames of the cameras.
        """
        begun_s = time.monotonic()
        is_told = False
        while not self._stopping():
            (replies,) = ask(self._link.session, [Query(self._key("*"))], self._stopping)
            found = {about.node: about for _, about in messages_in(replies, NodeDescription)}
            missing = [name for name in self._names if not self._follow(found.get(name), cameras)]
            if not missing:
                return
            waited_s = time.monotonic() - begun_s
            if timeout_s is not None and waited_s > timeout_s:
                raise ExpectationNotMet(_why_not(missing[0], found, cameras))
            if waited_s > TELL_S and not is_told:
                is_told = True
                log.warning("waiting: %s", _why_not(missing[0], found, cameras))
            time.sleep(ASK_S)

    def wait(self, header: Header, done: Callable[[], bool] | None = None) -> bool:
        """Wait until each node that takes a camera's frames has answered one.

        ``done`` is asked every ``POLL_S``, and waited for instead of the answers.

        Returns:
            False if told to stop meanwhile.

        Raises:
            ExpectationNotMet: A node or the router has gone, or a node has not answered in time.
        """
        frame = header.camera, header.epoch, header.seq
        asked = [each for each in self._followers.values() if header.camera in each.cameras]
        begun_s = looked_s = time.monotonic()

        def answered() -> bool:
            return all(each.has_answered(frame) for each in asked)

        while not self._arrived.wait_for(done or answered, POLL_S):
            if self._stopping():
                return False
            now_s = time.monotonic()
            late = next((each.name for each in asked if not each.has_answered(frame)), None)
            if late is not None and now_s - looked_s > LOOK_S:
                looked_s = now_s
                which = f"frame {header.seq} of {header.camera}"
                if self._has_ended(late):
                    gone = f"{late} ended before it"
                    if not self._link.connected:
                        gone = f"the router was lost before {late}"
                    raise ExpectationNotMet(f"{gone} answered {which}")
                if now_s - begun_s > self._answer_s:
                    raise ExpectationNotMet(
                        f"{late} has not answered {which} within {self._answer_s:g} s"
                    )
        if done is None:
            for each in asked:
                each.answered.pop(header.camera, None)  # it may be sent again, after a jump
        return True

    def _key(self, node: str) -> str:
        return keys.node_key(self._namespace, node)

    def _has_ended(self, name: str) -> bool:
        query = Query(self._key(name), tokens=True)
        (replies,) = ask(self._link.session, [query], self._stopping)
        return not (replies or replies.timed_out or self._stopping())

    def _follow(self, about: NodeDescription | None, cameras: Collection[str]) -> bool:
        """Follow a node once it takes frames of some of the cameras; return whether it does."""
        if about is None:
            return False
        taken = _taken(about, self._namespace) & set(cameras)
        if not taken:
            return False
        if about.node not in self._followers:
            follower = Follower(about.node, frozenset(taken), about.subscribes)
            self._followers[about.node] = follower
            for key in answer_keys(about.publishes):
                self._subscribe(key, follower)
        return True

    def _subscribe(self, key: str, follower: Follower) -> None:
        def receive(sample: zenoh.Sample) -> None:
            if sample.attachment is None:
                return
            try:
                header = Header.from_bytes(sample.attachment.to_bytes())
            except PayloadError:
                return
            if header.node == follower.name:
                follower.note((header.camera, header.epoch, header.seq))
                self._arrived.set()

        self._declared.append(
            self._link.declare(lambda session: session.declare_subscriber(key, direct(receive)))
        )


def answer_keys(published: Sequence[str]) -> list[str]:
    """Return the keys on which a node answers frames: those of its messages, else all of them."""
    found = [key for key in published if not key.startswith("@")]
    topics = {key: topic_of(key) for key in found}
    messages = [
        key
        for key, topic in topics.items()
        if topic is None or (topic.message is not None and not topic.by_query)
    ]
    return messages or found


def _taken(about: NodeDescription, namespace: str) -> set[str]:
    """Return the cameras whose frames a node takes."""
    taken = set()
    for key in about.subscribes:
        chunks = key.split("/")
        if chunks[0] == namespace and is_frame_key(key):
            taken |= set(about.cameras) if chunks[1] == "*" else {chunks[1]}
    return taken


def _why_not(name: str, found: Mapping[str, NodeDescription], cameras: Collection[str]) -> str:
    about = found.get(name)
    if about is None:
        running = ", ".join(sorted(found)) or "none"
        return f"{name} does not run; nodes that run: {running}"
    return (
        f"{name} takes no frames of {', '.join(sorted(cameras)) or 'any camera'}; it subscribes "
        f"to {', '.join(about.subscribes) or 'nothing'}"
    )
