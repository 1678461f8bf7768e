"""``zv bag verify``: runs a service on recorded frames, and compares what it says of each."""

from __future__ import annotations

import shlex
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from zenoh_vision import keys
from zenoh_vision.config.constraints import toml_line
from zenoh_vision.config.settings import Settings, load_settings, local_path, read_config
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, SourceError
from zenoh_vision.host.files import write_file
from zenoh_vision.host.signals import StopSignals
from zenoh_vision.topics import is_frame_key, topic_of
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.matching import intersect
from zv.bag.comparison import MISSING, Difference, Tolerances, first_difference, values_of
from zv.bag.private_system import zv_command
from zv.bag.record import ChunkLost, Record
from zv.bag.recorder.syncer import said
from zv.bag.recording import Recording
from zv.registry import SERVICES, command_of, model_of
from zv.tools.bag.answered import HORIZON_NS, AnsweredFrame, answered_frames, frame_id, is_latched
from zv.tools.bag.difference_picture import drawn
from zv.tools.bag.recorded_node import RecordedNode, recorded_node
from zv.tools.bag.service_run import ServiceRun, marked
from zv.tools.bag.tape import LATCHED
from zv.tools.bag.updated import Updated
from zv.tools.bag.verify_options import VerifyOptions, assigned
from zv.tools.shared.output import Output
from zv.tools.shared.received import header_of

EARLIER_NS: Final = 10**9
"""A node that was started longer before the recording knows what the recording does not have."""

FRAMES_AFTER: Final = 2
"""After so many frames of its camera all is said of a frame. A tracker ends the tracks of an epoch
when the next one begins, after its first message of that."""


@dataclass(slots=True)
class Tally:
    """What was done: frames sent and left out, messages compared, recorded time and time taken."""

    frames: int = 0
    unanswered: int = 0
    messages: int = 0
    recorded_ns: int = 0
    took_s: float = 0.0


def run(options: VerifyOptions, _connection: Connection, output: Output) -> None:
    """Verify a node, or write a recording with its results of now.

    Needs no router: the service and its own one run for this alone.

    Raises:
        ConfigurationError: Settings or flags are wrong.
        ExpectationNotMet: A result differs, or the service does not answer.
        RecordingError: The file cannot be read or written.
    """
    with StopSignals() as signals, Recording(options.file) as recording:
        is_new = options.update is not None
        node = recorded_node(recording, options.node, may_be_new=is_new)
        Verification(recording, node, options, output, lambda: signals.stopping).run()


class Verification:
    """One run of a node over an open recording."""

    def __init__(
        self,
        recording: Recording,
        node: RecordedNode,
        options: VerifyOptions,
        output: Output,
        stopping: Callable[[], bool],
    ) -> None:
        self._recording = recording
        self._node = node
        self._options = options
        self._output = output
        self._stopping = stopping
        self._tally = Tally()
        self._tolerances = tolerances(options)
        self._revision = 0
        self._held: tuple[AnsweredFrame, list[Record], Difference] | None = None

    def run(self) -> None:
        """Send the frames, compare the answers or write them."""
        node, options = self._node, self._options
        first = self._first()
        self._revision = revision_of(first.answers)
        self._remark(first)
        answers = sorted(self._answer_keys()) if options.update is None else ()
        with ExitStack() as opening:
            command = opening.enter_context(self._command())
            service = opening.enter_context(
                ServiceRun(
                    command,
                    node.name,
                    node.namespace,
                    node.cameras,
                    self._stopping,
                    answers=answers,
                    answer_s=options.answer,
                )
            )
            if options.update is not None:
                self._update(service, Path(options.update))
            else:
                self._verify(service)

    def _frames(self) -> Iterator[AnsweredFrame]:
        """Yield the frames of the node's cameras, each with its recorded answers."""
        return answered_frames(self._recording.records(), self._is_frame, self._is_answer)

    def _is_frame(self, record: Record) -> bool:
        return (
            is_frame_key(record.key)
            and record.key.startswith(f"{self._node.namespace}/")
            and keys.camera_of(record.key) in self._node.cameras
            and not record.deleted
        )

    def _is_answer(self, record: Record) -> bool:
        return (
            record.header.get("node") == self._node.name
            and record.origin == "stream"
            and not record.key.startswith("@")
        )

    def _first(self) -> AnsweredFrame:
        """Return the first frame that is sent.

        Raises:
            ExpectationNotMet: There is none.
        """
        everything = self._options.all_frames or self._options.update is not None
        for each in self._frames():
            if each.answers or everything:
                return each
        raise ExpectationNotMet(
            f"{self._recording.path} has no results of {self._node.name} for the frames of "
            f"{', '.join(self._node.cameras)}; --update FILE.mcap writes a recording that has them"
        )

    def _answer_keys(self) -> set[str]:
        """Return the keys of the node's recorded answers, of the whole recording."""
        found: set[str] = set()
        recorded = self._recording.keys()
        for key in recorded:
            if key.startswith(f"{self._node.namespace}/") and not is_frame_key(key):
                record = next(iter(self._recording.records(keys=(key,))), None)
                if record is not None and record.header.get("node") == self._node.name:
                    found.add(key)
        return found

    def _remark(self, first: AnsweredFrame) -> None:
        """Say what makes equal results unlikely, if they are compared."""
        if self._options.update is not None:
            return
        node = self._node
        for started_ns in node.starts_ns[:1]:
            before_s = (first.frame.log_time_ns - started_ns) / 1e9
            if before_s * 1e9 > EARLIER_NS:
                self._output.note(
                    f"{node.name} had run for {before_s:.0f} s before its first recorded frame; "
                    "what it had learned is not in the recording, so its results may differ. "
                    "--update writes a recording of a run from the start"
                )
        for started_ns in node.starts_ns[1:]:
            at_s = (started_ns - self._recording.start_ns) / 1e9
            self._output.note(
                f"{node.name} was started again {at_s:.2f} s into the recording, and had learned "
                "nothing then, so its results may differ. `zv bag cut` makes a recording of each "
                "run"
            )
        if node.routes - {"jpeg"} and first.frame.encoding == keys.JPEG:
            self._output.note(
                f"{node.name} took its frames as pixels, and the recording has JPEGs made from "
                'them, so its results may differ; transport = "jpeg" makes it take what is recorded'
            )

    # The service

    @contextmanager
    def _command(self) -> Iterator[list[str]]:
        """Yield the command of the service, with its settings."""
        node, options = self._node, self._options
        if options.command is not None:
            if options.config or options.set_:
                raise ConfigurationError("--command: give settings as flags of the command itself")
            yield shlex.split(options.command)
            return
        if node.service not in SERVICES:
            built_in = ", ".join(name for name in SERVICES if SERVICES[name].consumes)
            raise ConfigurationError(
                f"{node.name} is of the service {node.service}, which is none of {built_in}; "
                "--command starts it"
            )
        with TemporaryDirectory(prefix="zv-verify-") as folder:
            file = Path(folder) / f"{node.service}.toml"
            file.write_text(self._settings())
            camera = ",".join(node.cameras)
            flags = ("--camera", camera, "--config", str(file))
            yield zv_command(command_of(node.service), *flags)

    def _settings(self) -> str:
        """Return the settings of the service as TOML: recorded, or given."""
        model, options = model_of(self._node.service), self._options
        values: dict[str, Any] = {}
        folder = Path()
        if options.config is not None:
            values, folder = read_config(options.config)[0], Path(options.config).parent
        else:
            recorded = self._node.settings(self._revision)
            values = {name: value for name, value in recorded.items() if name in model.model_fields}
            if unknown := sorted(set(recorded) - set(values)):
                self._output.note(f"this version has no {', '.join(unknown)}, which was recorded")
            if values.get("transport") == "shm":
                values["transport"] = "auto"  # the frames come over the network here
        given = dict(map(assigned, options.set_))
        typed = load_settings(model, flags=given, config=options.config)
        values = _absolute(model, values, folder)
        values |= _absolute(model, {name: getattr(typed, name) for name in given}, Path())
        return "\n".join(toml_line(name, value) for name, value in values.items())

    def _prepare(self, service: ServiceRun, each: AnsweredFrame) -> None:
        """Send what belongs to a frame and comes before it; follow changes of parameters."""
        for record in filter(self._concerns, each.others):
            service.send(record)
        revision = revision_of(each.answers)
        if revision > self._revision and self._options.config is None:
            given = dict(map(assigned, self._options.set_))
            changes = {
                name: value
                for number in sorted(self._node.changes)
                if self._revision < number <= revision
                for name, value in self._node.changes[number].items()
                if name not in given
            }
            if changes:
                service.set(changes)
        self._revision = max(revision, self._revision)

    def _concerns(self, record: Record) -> bool:
        """Tell whether a record that is no frame is input of the node."""
        if record.key.startswith("@") or record.deleted:
            return False
        if keys.suffix_of(record.key) in LATCHED:
            return keys.camera_of(record.key) in self._node.cameras
        if is_frame_key(record.key):
            return False
        return any(intersect(each, record.key) for each in self._node.subscribes)

    def _answered(
        self, service: ServiceRun, frames: Iterable[AnsweredFrame]
    ) -> Iterator[tuple[AnsweredFrame, list[Record]]]:
        """Send frames; yield each, in their order, with all that the service says of it."""
        begun_s, begun_ns = time.monotonic(), time.time_ns()
        sent: deque[AnsweredFrame] = deque()
        waiting: Counter[str] = Counter()
        for each in frames:
            self._check_header(each.frame)
            self._prepare(service, each)
            awaited = None if self._options.update else _awaited(each.answers) or None
            results, later = map(partial(filter, self._concerns), each.results_by_answer())
            service.send_frame(marked(each.frame, begun_ns), awaited, results, later)
            self._check_going_on()
            sent.append(each)
            waiting[each.frame.key] += 1
            while (
                waiting[sent[0].frame.key] > FRAMES_AFTER
                or each.frame.log_time_ns - sent[0].frame.log_time_ns > HORIZON_NS
            ):
                one = sent.popleft()
                waiting[one.frame.key] -= 1
                yield one, service.take_answers(one.frame)
        self._tally.took_s = time.monotonic() - begun_s
        service.wait_for_late_ones()
        for one in sent:
            yield one, service.take_answers(one.frame)

    # Comparing

    def _verify(self, service: ServiceRun) -> None:
        tally = self._tally
        first_ns = 0
        for each, found in self._answered(service, self._frames_to_verify()):
            if self._held is not None and each.answers:
                self._fail(*self._held)  # the recording went on
            self._check_unexpected(service, each)
            if each.answers:
                difference = first_difference(each.answers, found, self._tolerances)
                if difference is not None:
                    self._differs(each, found, difference)
            tally.frames += 1
            tally.messages += len(found)
            first_ns = first_ns or each.frame.log_time_ns
            tally.recorded_ns = each.frame.log_time_ns - first_ns
        if self._held is not None:
            _, _, difference = self._held
            self._output.note(
                f"the recording ends within the results of its last frame: no {difference.key}"
            )
        self._report(tally.recorded_ns / 1e9 / tally.took_s)

    def _frames_to_verify(self) -> Iterator[AnsweredFrame]:
        """Yield the frames with recorded answers, with ``--all-frames`` all; count the others."""
        latched: dict[str, Record] = {}  # the newest of each key before frames that are left out
        for each in self._frames():
            self._tally.unanswered += not each.answers
            if each.answers or self._options.all_frames:
                each.others[:0] = latched.values()
                latched.clear()
                yield each
            else:
                found = filter(is_latched, filter(self._concerns, each.others))
                latched |= {record.key: record for record in found}

    def _report(self, speed: float) -> None:
        tally, name = self._tally, self._node.name
        left = f"; {tally.unanswered} frames without a recorded result were left out"
        left = left if tally.unanswered and not self._options.all_frames else ""
        self._output.result(
            {
                "node": name,
                "same": True,
                "frames": tally.frames,
                "messages": tally.messages,
                "left_out": tally.unanswered,
                "speed": round(speed, 2),
            },
            f"{name}: {tally.frames} frames, {tally.messages} messages as recorded; "
            f"{speed:.1f} times real time{left}",
        )

    def _check_unexpected(self, service: ServiceRun, each: AnsweredFrame) -> None:
        """Fail if a message came after all that were recorded of its frame."""
        for record in service.unexpected():
            if frame_id(record) is not None and not self._options.all_frames:
                difference = Difference(record.key, "", MISSING, values_of(record))
                self._differs(each, [record], difference)

    def _differs(self, each: AnsweredFrame, found: list[Record], difference: Difference) -> None:
        """Fail; later if the recording may have ended between the messages of this frame.

        So it does where the recorder was stopped while they were on their way. A message that
        there is for each frame is held against the node if another frame's results follow.
        """
        topic = topic_of(difference.key)
        is_absent = difference.recorded == MISSING and not difference.field
        if is_absent and topic is not None and topic.every_frame:
            self._held = self._held or (each, found, difference)
        else:
            self._fail(each, found, difference)

    def _fail(self, each: AnsweredFrame, found: list[Record], difference: Difference) -> None:
        """Write the picture, and say what differs.

        Raises:
            ExpectationNotMet: Always.
        """
        options, frame = self._options, each.frame.header
        if found:
            frame = found[0].header
        path = options.picture or f"{Path(options.file).stem}.difference.png"
        shown: str | None = path
        words = f"picture: {path}"
        try:
            write_file(path, drawn(each.frame, each.answers, found, difference))
        except SourceError as error:
            shown, words = None, f"no picture: {error}"
        at_s = (each.frame.log_time_ns - self._recording.start_ns) / 1e9
        if self._output.as_json:
            self._output.record(
                {
                    "node": self._node.name,
                    "same": False,
                    "frames": self._tally.frames,
                    "frame": {name: frame.get(name) for name in ("camera", "epoch", "seq")},
                    "at_s": round(at_s, 3),
                    "key": difference.key,
                    "field": difference.field,
                    "recorded": difference.recorded,
                    "now": difference.now,
                    "tolerance": difference.tolerance,
                    "picture": shown,
                }
            )
        raise ExpectationNotMet(
            f"{self._node.name} differs at frame {frame.get('seq')} of {frame.get('camera')}, "
            f"{at_s:.2f} s into the recording, after {self._tally.frames} frames as recorded: "
            f"{difference.text()}; {words}"
        )

    def _check_header(self, frame: Record) -> None:
        if header_of(frame.attachment) is None:
            raise ExpectationNotMet(f"a frame on {frame.key} was recorded with a broken header")

    def _check_going_on(self) -> None:
        if self._stopping():
            raise ExpectationNotMet(f"told to stop after {self._tally.frames} frames")

    # Writing

    def _update(self, service: ServiceRun, path: Path) -> None:
        """Write the recording with the answers of now instead of the recorded ones."""
        tally = self._tally
        try:
            with Updated(path, self._recording, self._is_answer) as updated:
                updated.describe(self._node, service.about, service.parameters())
                for each, found in self._answered(service, self._frames()):
                    if not found:
                        seq = each.frame.header.get("seq")
                        self._output.note(f"{self._node.name} has not answered frame {seq}")
                    updated.add(each.frame, found)
                    service.unexpected()  # of no frame: no result
                    tally.frames += 1
        except (OSError, ChunkLost) as error:
            raise SourceError(f"cannot write {path}: {said(error)}") from None
        self._output.result(
            {
                "node": self._node.name,
                "frames": tally.frames,
                "messages": updated.answers,
                "file": str(path),
            },
            f"{path}: {tally.frames} frames, {updated.answers} messages of {self._node.name}",
        )


def _absolute(model: type[Settings], values: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return settings with paths that a file in any folder may have; theirs are of ``folder``."""
    return {
        name: str((folder / value).absolute()) if local_path(model, name, value) else value
        for name, value in values.items()
    }


def _awaited(answers: list[Record]) -> Counter[str]:
    """Return how many messages of each key to wait for before the next frame is sent.

    What is not said of every frame, such as an event, may come only with the next one.
    """
    topics = ((each.key, topic_of(each.key)) for each in answers)
    return Counter(key for key, topic in topics if topic is None or topic.every_frame)


def revision_of(answers: list[Record]) -> int:
    """Return the revision of the parameters with which answers were made; 0 if unknown."""
    return max((each.number("revision") or 0 for each in answers), default=0)


def tolerances(options: VerifyOptions) -> Tolerances:
    """Return the tolerances that the flags give."""
    general = None
    by_field: dict[str, float] = {}
    for text in options.tolerance:
        name, _, value = text.rpartition("=")
        if name:
            by_field[name] = float(value)
        else:
            general = float(value)
    return Tolerances(general, by_field, frozenset(options.ignore))
