"""Finds the answers of a node to each frame in a recording, without holding all of it."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from zenoh_vision import keys
from zenoh_vision.node.lockstep import FrameId
from zv.bag.record import Record
from zv.tools.bag.tape import LATCHED

HORIZON_NS = 5 * 10**9
"""A node answers a frame within this time of the recording."""

LATE_NS = 2 * 10**9
"""What comes later than this after the first answer is about the silence that followed the frame:
that it ended tracks, for example. It does not follow from the frames."""

MOST_WAITING_BYTES = 256 << 20
MOST_EARLY = 16
"""Frames of which answers are kept that came before them."""


@dataclass(slots=True)
class AnsweredFrame:
    """A frame, and what a node said of it.

    Attributes:
        others: Records that stand before it, since the frame before.
        results: What other nodes said of it later: the node may wait for that to answer.
    """

    frame: Record
    others: list[Record] = field(default_factory=list)
    answers: list[Record] = field(default_factory=list)
    results: list[Record] = field(default_factory=list)

    def results_by_answer(self) -> tuple[list[Record], list[Record]]:
        """Return the results that came before the node's last answer, and those that came after."""
        if not self.answers:
            return self.results, []
        last_ns = max(each.log_time_ns for each in self.answers)
        before = [each for each in self.results if each.log_time_ns <= last_ns]
        return before, [each for each in self.results if each.log_time_ns > last_ns]

    @property
    def size(self) -> int:
        """Bytes of what belongs to the frame."""
        records = (self.frame, *self.answers, *self.results)
        return sum(len(each.payload) for each in records)


def frame_id(record: Record) -> FrameId | None:
    """Return the identity of the frame to which a record belongs; None without a header."""
    header = record.header
    camera, epoch, seq = header.get("camera"), header.get("epoch"), header.get("seq")
    if isinstance(camera, str) and type(epoch) is int and type(seq) is int:
        return camera, epoch, seq
    return None


def is_latched(record: Record) -> bool:
    """Tell whether a record holds from when it came, whatever frame its header names."""
    return keys.suffix_of(record.key) in LATCHED


def answered_frames(
    records: Iterable[Record],
    is_frame: Callable[[Record], bool],
    is_answer: Callable[[Record], bool],
) -> Iterator[AnsweredFrame]:
    """Yield each frame that has an identity, in their order, with its answers.

    Args:
        records: In the order of their arrival.
        is_frame: Which of them are frames.
        is_answer: Which are what the node said; one without a frame is left out. Messages overtake
            pictures, so one may stand before its frame.
    """
    waiting: OrderedDict[FrameId, AnsweredFrame] = OrderedDict()
    early: OrderedDict[FrameId, list[Record]] = OrderedDict()
    others: list[Record] = []
    size = 0
    for record in records:
        found = frame_id(record)
        if found is not None and is_answer(record):
            is_early = found not in waiting
            answers = early.setdefault(found, []) if is_early else waiting[found].answers
            if not answers or record.log_time_ns - answers[0].log_time_ns < LATE_NS:
                answers.append(record)
                size += 0 if is_early else len(record.payload)
            if len(early) > MOST_EARLY:
                early.popitem(last=False)
        elif found is not None and is_frame(record):
            if found not in waiting:  # else it was recorded in two forms
                answers = early.pop(found, [])
                waiting[found] = AnsweredFrame(record, others, answers)
                others = []
                size += waiting[found].size
        elif found is not None and found in waiting and not is_latched(record):
            waiting[found].results.append(record)
            size += len(record.payload)
        else:
            others.append(record)
        while waiting:
            oldest = next(iter(waiting.values()))
            age_ns = record.log_time_ns - oldest.frame.log_time_ns
            if age_ns <= HORIZON_NS and size <= MOST_WAITING_BYTES:
                break
            waiting.popitem(last=False)
            size -= oldest.size
            yield oldest
    yield from waiting.values()
