"""``zv bag play``: sends a recording again, as a node that can be paused, moved and slowed down."""

from __future__ import annotations

import logging
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from typing import Final

import zenoh

from zenoh_vision import keys
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.errors import (
    ConfigurationError,
    ExpectationNotMet,
    ParameterRefused,
)
from zenoh_vision.host.allocator import keep_freed_memory
from zenoh_vision.host.clock import SYSTEM_CLOCK
from zenoh_vision.host.lifeline import end_with_parent
from zenoh_vision.messages import Header, Level, NodeDescription, Replay
from zenoh_vision.node.lockstep import FrameId, Lockstep
from zenoh_vision.node.node import Node
from zenoh_vision.topics import REPLAY, Topic, is_frame_key, topic_of
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.declarations import ROUTERS
from zenoh_vision.transport.publisher import Outgoing, StreamPublisher
from zenoh_vision.transport.query import Query, ask
from zv.bag.record import Record
from zv.bag.recording import Recording
from zv.bag.replayed import Names, Pass, Replayed, Sent
from zv.tools.bag.answered import frame_id
from zv.tools.bag.keyboard import HELP, Keyboard
from zv.tools.bag.live_nodes import LiveWatch, camera_among, publishers
from zv.tools.bag.play_options import MAX_SPEED, PlayerParameters, PlayOptions, renamed
from zv.tools.bag.player import Player, Wish
from zv.tools.bag.tape import RecordedTape
from zv.tools.shared.output import Output
from zv.tools.shared.received import header_of
from zv.tools.shared.session import ToolSession
from zv.tools.shared.statistics import Distribution

log = logging.getLogger("player")

SERVICE: Final = "player"
FLUSH_S: Final = 5.0
LEAP_S: Final = 5.0
STATE_NS: Final = 200_000_000
MOST_MARKS: Final = 500
COUNTS: Final = ("read", "published")
DEVIATIONS: Final = ("p50", "p99", "max")
MATCH_S: Final = 5.0
"""How long the subscription of a node that is waited for may take to arrive here."""

Turn = tuple[int, FrameId | None]
"""When a pass began, and a frame in it."""


def run(options: PlayOptions, connection: Connection, output: Output) -> None:
    """Play the recording until its end, or until told to stop.

    Raises:
        ConfigurationError: Names, times or key expressions do not fit the recording.
        ExpectationNotMet: A live camera has the same name, a node does not answer, or the
            credentials do not allow to send what was recorded.
        RecordingError: The file cannot be read.
        RouterUnreachable: No router within the connection's time.
    """
    keep_freed_memory()
    end_with_parent()
    with Recording(options.file) as recording:
        tape = RecordedTape(recording, options.keys, options.exclude, options.start, options.end)
        names, connection = names_for(tape, options.as_, connection)
        with Playing(tape, names, options, connection, output) as playing:
            playing.run()
            counts, passes = playing.sent, playing.player.begun
            spread = playing.deviation_ms.spread()
        figures = {name: round(spread[name], 3) for name in DEVIATIONS} if spread else None
        total = sum(counts.values())
        length_s = (tape.end_ns - tape.begin_ns) / 1e9
        paced = "" if figures is None else f"; p99 of the deviation {figures['p99']:.2f} ms"
        passed = f" in {passes} passes" if passes > 1 else ""
        output.result(
            {"samples": total, "keys": dict(counts), "passes": passes, "deviation_ms": figures},
            f"played {total} samples of {length_s:.1f} s{passed}{paced}",
        )


def names_for(
    tape: RecordedTape, as_: str | None, connection: Connection
) -> tuple[Names, Connection]:
    """Return the names under which a tape is played, and the connection with its namespace.

    Raises:
        ConfigurationError: The recording has no such camera, or several, or several namespaces.
    """
    cameras: dict[str, str] = {}
    for old, new in ({} if as_ is None else renamed(as_)).items():
        known = ", ".join(tape.cameras) or "none"
        if not old and len(tape.cameras) != 1:
            raise ConfigurationError(f"--as {new}: give OLD=NEW; cameras of the recording: {known}")
        if old and old not in tape.cameras:
            raise ConfigurationError(f"--as {old}={new}: cameras of the recording: {known}")
        cameras[old or tape.cameras[0]] = new
    played: dict[str, str] = {}
    for camera in tape.cameras:
        name = cameras.get(camera, camera)
        if name in played:
            raise ConfigurationError(
                f"--as {as_}: cameras {played[name]} and {camera} would both be played as {name}"
            )
        played[name] = camera
    recorded = tape.namespaces
    if connection.any_namespace and len(recorded) == 1:
        return Names(cameras), replace(connection, namespace=recorded[0])
    if not connection.any_namespace and len(recorded) > 1:
        raise ConfigurationError(
            f"--namespace {connection.namespace}: the recording has several: "
            f"{', '.join(recorded)}; choose one with --keys 'NAME/**'"
        )
    into = connection.namespace
    return Names(
        cameras, {} if connection.any_namespace else dict.fromkeys(recorded, into)
    ), connection


class Playing:
    """A tape, and the node that sends it; opened by ``with``."""

    def __init__(
        self,
        tape: RecordedTape,
        names: Names,
        options: PlayOptions,
        connection: Connection,
        output: Output,
    ) -> None:
        self._tape = tape
        self._options = options
        self._output = output
        self._connection = connection
        self._keys = {key: names.key(key) for key in tape.keys}
        cameras = tuple(names.cameras.get(each, each) for each in tape.cameras)
        self._cameras = cameras
        self._parameters = ParameterStore(options.parameters())
        self._node = Node(
            SERVICE,
            camera=cameras[0] if len(cameras) == 1 else cameras,
            connection=connection,
            counts=COUNTS,
            parameters=self._parameters,
        )
        self._lossless = bool(options.nodes) or options.speed == 0
        self._samples = Replayed(
            names,
            mark=not options.unmarked,
            renew=options.now,
            lockstep=bool(options.nodes) and not options.unmarked,
        )
        self._streams: dict[str, StreamPublisher] = {}
        self._live: frozenset[str] = frozenset()
        self._blocked = ""
        self._lockstep: Lockstep | None = None
        self._unanswered: dict[str, tuple[Turn, Header]] = {}  # each camera's last frame
        self._open = ExitStack()
        self.sent: Counter[str] = Counter()
        self.deviation_ms = Distribution()
        self._marks = tuple(tape.marks(MOST_MARKS))
        self._told_ns = 0
        self._states: list[StreamPublisher] = []
        self.player = Player(
            tape,
            self._wish,
            self._send,
            lambda one: is_frame_key(one.key),
            self._stopping,
            SYSTEM_CLOCK,
            lambda: self._change({"paused": True}),
            self._wait_for_answers,
        )

    def __enter__(self) -> Playing:
        """Look for live nodes, open the node, and wait for those that are waited for."""
        with ToolSession(self._connection) as session:
            self._look_first(session)
            played = sorted(set(self._keys.values()) - self._live)
            for key in played:
                session.require("publish", key)
        with ExitStack() as opening:
            node = opening.enter_context(self._node)
            for key in played:
                self._streams[key] = node.add_stream(key, topic_for(key, lossless=self._lossless))
            for camera in self._cameras if self._options.timeline else ():
                key = REPLAY.key(node.connection.namespace, camera)
                self._states.append(node.add_stream(key, REPLAY))
            if self._options.nodes:
                self._lockstep = opening.enter_context(self._following())
            watch = LiveWatch(node.link, node.connection.namespace, self._look_again)
            opening.callback(watch.close)
            self._look_again()  # what has started since the first look
            self._synchronize()
            self._open = opening.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def run(self) -> None:
        """Play until the end, or until told to stop."""
        self._parameters.watch(lambda _: self.player.changed.set())
        name = os.path.basename(self._options.file)
        with Keyboard(self._press) as keyboard:
            at = f"{(self._tape.end_ns - self._tape.begin_ns) / 1e9:.1f} s"
            self._output.note(f"playing {name}, {at}, as {self._node.name}")
            if keyboard.active:
                self._output.note(HELP)
            self.player.run()
            for camera in [*self._unanswered]:
                self._wait_for(camera)
        self._synchronize()

    def _synchronize(self) -> None:
        """Wait for a reply of the router.

        It proves that all that was declared or sent before has arrived there, and that this session
        knows who subscribes. Without that the first samples, and the last ones, may get lost.
        """
        with suppress(zenoh.ZError):
            ask(self._node.link.session, [Query(ROUTERS, timeout_s=FLUSH_S)])

    # Live nodes

    def _look_first(self, session: ToolSession) -> None:
        """Refuse to play beside a live camera; leave out what other nodes publish now."""
        found = publishers(
            session.link, session.namespace, self._keys.values(), lambda: session.stopping
        )
        if words := camera_among(found):
            raise ExpectationNotMet(words)
        self._tell(found, found.keys())
        self._live = frozenset(found)

    def _look_again(self) -> None:
        """Pause when a live camera has started meanwhile; on the thread of the watch."""
        node = self._node
        with suppress(zenoh.ZError):
            found = publishers(
                node.link,
                node.connection.namespace,
                self._keys.values(),
                self._stopping,
                player=node.name,
            )
            blocked = camera_among(found)
            if blocked != self._blocked:
                self._blocked = blocked
                log.warning("%s", f"paused: {blocked}" if blocked else "the live camera is gone")
                node.report("live camera", Level.ERROR if blocked else Level.OK, blocked)
                self.player.changed.set()
            self._tell(found, found.keys() - self._live)
            self._live = frozenset(found)

    def _tell(self, found: Mapping[str, NodeDescription], new: Iterable[str]) -> None:
        for key in sorted(key for key in new if not is_frame_key(key)):
            self._output.note(
                f"{found[key].node} publishes {key} now: what was recorded is not played"
            )

    # Lockstep

    @contextmanager
    def _following(self) -> Iterator[Lockstep]:
        node, options = self._node, self._options
        lockstep = Lockstep(
            node.link,
            node.connection.namespace,
            options.nodes,
            self._stopping,
            answer_s=options.answer,
        )
        try:
            lockstep.find(self._cameras, node.connection.timeout_s)
            for key, stream in self._streams.items():
                if is_frame_key(key) and lockstep.takes(key):
                    self._wait_for_subscriber(stream)
            yield lockstep
        finally:
            lockstep.close()

    def _wait_for_subscriber(self, stream: StreamPublisher) -> None:
        until_ns = SYSTEM_CLOCK.monotonic_ns() + round(MATCH_S * 1e9)
        while not stream.demand.exists and not self._stopping():
            if SYSTEM_CLOCK.monotonic_ns() > until_ns:
                return  # it takes the frames by another key
            SYSTEM_CLOCK.sleep(0.02)

    # The player's side

    def _stopping(self) -> bool:
        self._node.health.loop_alive()
        return self._node.stopping

    def _wish(self) -> Wish:
        now: PlayerParameters = self._parameters.newest.settings
        paused = now.paused or bool(self._blocked)
        steps = 0 if self._blocked else now.step
        self._tell_state(now, paused=paused)
        return Wish(now.speed, paused, steps, now.position, now.loop, self._options.stay)

    def _tell_state(self, now: PlayerParameters, *, paused: bool) -> None:
        """Publish where the replay is, ``STATE_NS`` after the last time."""
        now_ns = SYSTEM_CLOCK.monotonic_ns()
        if not self._states or now_ns - self._told_ns < STATE_NS:
            return
        self._told_ns = now_ns
        begin_ns, length_s = self._tape.begin_ns, (self._tape.end_ns - self._tape.begin_ns) / 1e9
        at_s = (self.player.time.position_ns - begin_ns) / 1e9
        message = Replay(
            node=self._node.name,
            file=os.path.basename(self._options.file)[:256],
            begin_ns=begin_ns,
            length_s=length_s,
            position_s=min(max(0.0, at_s), length_s),
            speed=now.speed,
            paused=paused,
            loop=now.loop,
            step=now.step,
            marks=self._marks,
        )
        for each in self._states:
            each.offer(lambda: Outgoing.message(message))

    def _wait_for_answers(self, record: Record, run: Pass) -> None:
        """Wait, before a camera's next frame, until the nodes have answered its last one."""
        if self._lockstep is None or not is_frame_key(record.key):
            return
        last = self._unanswered.get(keys.camera_of(record.key))
        # Another form of the frame, and what others said of it, may be what a node waits for.
        if last is not None and last[0] != (run.begun_ns, frame_id(record)):
            self._wait_for(keys.camera_of(record.key))

    def _wait_for(self, camera: str) -> None:
        if self._lockstep is not None:
            _, header = self._unanswered.pop(camera)
            self._lockstep.wait(header)

    def _send(self, record: Record, run: Pass) -> None:
        node = self._node
        node.counters.arrive()
        now_ns = SYSTEM_CLOCK.time_ns()
        sent = self._samples.sample(record, run, now_ns)
        stream = self._streams.get(sent.key)
        if stream is None or sent.key in self._live:
            node.counters.drop("live")
            return
        if record.deleted:
            node.link.session.delete(sent.key)
        else:
            stream.offer(lambda: Outgoing(sent.payload, record.encoding, sent.attachment))
        playing = self.player.time.speed and not self.player.time.paused
        if playing and record.log_time_ns >= self._tape.begin_ns:
            self.deviation_ms.add(abs(now_ns - run.due_ns(record.log_time_ns)) / 1e6)
        self.sent[sent.key] += 1
        node.counters.finish()
        node.health.done(None)
        if self._lockstep is not None and is_frame_key(record.key):
            turn = run.begun_ns, frame_id(record)
            self._unanswered[keys.camera_of(record.key)] = turn, whole_header(sent)

    def _press(self, word: str) -> None:
        """Do what a key of the terminal means, in the same way as a change over the network."""
        now: PlayerParameters = self._parameters.newest.settings
        here_s = (self.player.time.position_ns - self._tape.begin_ns) / 1e9
        changes: Mapping[str, Mapping[str, object]] = {
            "pause": {"paused": not now.paused},
            "step": {"paused": True, "step": now.step + 1},
            "forward": {"position": max(0.0, here_s + LEAP_S)},
            "back": {"position": max(0.0, here_s - LEAP_S)},
            "begin": {"position": 1e-9 if now.position == 0 else 0.0},
            "faster": {"speed": min(MAX_SPEED, now.speed * 2 or 1.0)},
            "slower": {"speed": max(1 / 64, now.speed / 2)},
        }
        if word == "quit":
            self._node.stop()
            self.player.changed.set()
            return
        self._change(changes[word])

    def _change(self, values: Mapping[str, object]) -> None:
        with suppress(ParameterRefused):
            self._parameters.change(values)


def topic_for(key: str, *, lossless: bool) -> Topic:
    """Return how the samples of a key are sent: by its topic, or as messages.

    ``lossless`` waits for a slow link instead of dropping frames, whatever the topic.
    """
    topic = topic_of(key)
    if topic is None:
        return Topic(key, "", None, delivery="message", lazy=False)
    delivery = "message" if lossless else topic.delivery
    return replace(topic, lazy=False, by_query=False, delivery=delivery)


def whole_header(sent: Sent) -> Header:
    """Return the header of a frame, by which its answers are known.

    Raises:
        ExpectationNotMet: It has none.
    """
    header = header_of(sent.attachment)
    if header is None:
        raise ExpectationNotMet(
            f"--lockstep: a frame on {sent.key} was recorded without a header, so no answer to it "
            "can be known"
        )
    return header
