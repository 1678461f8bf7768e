"""``Report``: what is in a recording, what is missing in it, and whether that is proven."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from zv.bag.recorder.ledger import NOT_RECEIVED, Ledger
from zv.bag.recording import Recording
from zv.bag.ros2.profile import PROFILE


@dataclass
class KeyReport:
    """What a recording has of one key.

    Attributes:
        count: Samples in the file.
        taken: Samples by the accounts.
        missed: By reason.
        epochs: First and last number, and how many between are missing, by epoch.
        unnumbered: Samples without epoch and number, whose loss would not be noticed.
        for_ros: The file has messages of ROS.
        explained: How many frames its sender says it dropped while this was recorded.
    """

    key: str
    encoding: str = ""
    count: int = 0
    taken: int = 0
    bytes: int = 0
    repeated: int = 0
    unnumbered: int = 0
    sender: str = ""
    missed: Counter[str] = field(default_factory=Counter)
    epochs: dict[int, tuple[int, int, int]] = field(default_factory=dict)
    explained: Counter[str] = field(default_factory=Counter)
    for_ros: bool = False

    @property
    def is_accounted(self) -> bool:
        """Whether the file has as many samples as its accounts say.

        ROS has no message for some samples, such as a centroid without an object.
        """
        return self.count == self.taken or (self.for_ros and 0 < self.count <= self.taken)

    @property
    def total_missed(self) -> int:
        """Samples that are known to be missing."""
        return sum(self.missed.values())

    @property
    def is_complete(self) -> bool:
        """Whether sequence numbers prove that nothing between first and last is missing."""
        proven = bool(self.epochs) and not self.unnumbered and self.is_accounted
        return proven and not self.total_missed

    @property
    def verdict(self) -> str:
        """``complete``, or what is missing, or why that is not known."""
        if self.is_complete:
            return "complete"
        if self.total_missed:
            reasons = ", ".join(f"{count} {reason}" for reason, count in self.missed.items())
            return f"missed {reasons}{self._explanation}"
        if self.unnumbered or not self.epochs:
            return "no sequence numbers"
        return f"not proven: {self.taken} accounted for"

    @property
    def _explanation(self) -> str:
        if not self.missed[NOT_RECEIVED] or not self.explained:
            return ""
        drops = ", ".join(
            f"{count} {reason.removeprefix('dropped.')}" for reason, count in self.explained.items()
        )
        return f"; {self.sender} dropped {drops}"

    def to_map(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {
            "key": self.key,
            "encoding": self.encoding,
            "messages": self.count,
            "bytes": self.bytes,
            "missed": dict(self.missed),
            "repeated": self.repeated,
            "unnumbered": self.unnumbered,
            "sender": self.sender,
            "sender_dropped": dict(self.explained),
            "epochs": [
                {"epoch": epoch, "first": first, "last": last, "missing": missing}
                for epoch, (first, last, missing) in self.epochs.items()
            ],
            "complete": self.is_complete,
        }


@dataclass
class Report:
    """What is in a recording.

    Attributes:
        ended: How it ended, in words.
        minutes: The accounts as they are in the file.
    """

    path: str
    size: int
    ended: str
    is_closed: bool
    start_ns: int
    end_ns: int
    about: Mapping[str, str]
    keys: list[KeyReport]
    minutes: list[dict[str, Any]]
    notes: list[str]
    problems: list[str]

    @property
    def is_complete(self) -> bool:
        """Whether every numbered key is complete, there is one, and the file is undamaged."""
        numbered = [each for each in self.keys if each.epochs]
        whole = self.is_closed and not self.problems
        return whole and bool(numbered) and all(each.is_complete for each in numbered)

    @property
    def messages(self) -> int:
        """Samples in the file, without what the recorder asked for."""
        return sum(each.count for each in self.keys)

    @property
    def missed(self) -> int:
        """Samples that are known to be missing, of all keys."""
        return sum(each.total_missed for each in self.keys)

    @property
    def verdict(self) -> str:
        """One word or sentence on completeness."""
        if self.is_complete:
            return "complete"
        if self.missed:
            return f"{self.missed} missed"
        if self.problems:
            return "damaged"
        return "completeness not proven" if self.is_closed else "not closed"

    def to_map(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {
            "file": self.path,
            "bytes": self.size,
            "ended": self.ended,
            "closed": self.is_closed,
            "start_ns": self.start_ns,
            "end_ns": self.end_ns,
            "seconds": round((self.end_ns - self.start_ns) / 1e9, 6),
            "complete": self.is_complete,
            "missed": self.missed,
            "about": dict(self.about),
            "keys": [each.to_map() for each in self.keys],
            "notes": self.notes,
            "problems": self.problems,
        }


def report_of(recording: Recording) -> Report:
    """Return the report of a recording; reads what its accounts do not cover.

    Raises:
        RecordingError: The disk fails, or the file was written by a newer version.
    """
    keys: dict[str, KeyReport] = {}
    minutes = list(recording.accounts())
    counts: Counter[str] = Counter()
    if recording.is_closed and recording.statistics is not None and not recording.problems:
        counts.update(recording.counts())
        tail = [] if minutes else [rest_account(recording, minutes)]
    else:
        tail = [rest_account(recording, minutes, counts)]
    notes: list[str] = []
    senders: dict[str, Counter[str]] = {}
    for account in (*minutes, *tail):
        _add(keys, senders, account)
        notes += [each for each in account["notes"] if each not in notes]
    for key, count in counts.items():
        if key in keys or recording.profile != PROFILE:  # boxes are no samples
            keys.setdefault(key, KeyReport(key)).count = count
    for channel in recording.channels():
        if channel.topic in keys:
            keys[channel.topic].encoding = channel.metadata.get("zenoh_encoding", "")
    for each in keys.values():
        each.missed = +each.missed  # what came late was counted as missed, and then taken back
        each.explained = senders.get(each.sender, Counter())
        each.for_ros = recording.profile == PROFILE
    return Report(
        path=str(recording.path),
        size=recording.size,
        ended=_ended(recording),
        is_closed=recording.is_closed,
        start_ns=recording.start_ns,
        end_ns=recording.end_ns,
        about=recording.about,
        keys=sorted(keys.values(), key=lambda each: each.key),
        minutes=minutes,
        notes=notes,
        problems=list(recording.problems),
    )


def rest_account(
    recording: Recording,
    minutes: Sequence[Mapping[str, Any]],
    counts: Counter[str] | None = None,
    notes: Sequence[str] = (),
) -> dict[str, Any]:
    """Return the account of what came after the last account of a recording.

    ``counts`` gets the number of published records of the whole recording added, by key.
    """
    ledger = Ledger()
    ledger.resume(minutes)
    begin_ns = max((each["end_ns"] for each in minutes), default=0)
    start_ns = None if counts is not None else begin_ns
    for record in recording.records(start_ns=start_ns):
        if counts is not None and record.origin == "stream":
            counts[record.key] += 1
        if record.log_time_ns > begin_ns and record.origin == "stream":
            ledger.take(record)
    for each in notes:
        ledger.note(each)
    return ledger.account(begin_ns, recording.end_ns)


def _add(
    keys: dict[str, KeyReport], senders: dict[str, Counter[str]], account: Mapping[str, Any]
) -> None:
    for key, fields in account["keys"].items():
        found = keys.setdefault(key, KeyReport(key))
        for name in ("taken", "bytes", "repeated", "unnumbered"):
            setattr(found, name, getattr(found, name) + fields[name])
        found.sender = fields["sender"] or found.sender
        found.missed.update(fields["missed"])
        for each in fields["epochs"]:
            first, _, missing = found.epochs.get(each["epoch"], (each["first"], 0, 0))
            found.epochs[each["epoch"]] = first, each["last"], missing + each["missing"]
    for node, reasons in account["senders"].items():
        senders.setdefault(node, Counter()).update(reasons)


def _ended(recording: Recording) -> str:
    how = recording.end.get("how", "")
    if recording.is_closed:
        return how or "closed"
    if recording.is_being_written():
        return "not closed: it is being written"
    return "not closed: the recorder was killed; `zv bag repair` writes the index"
