"""The account of a recording: by key, what was taken and what was missed, proven by numbers.

Frames of a camera are numbered without gaps within an epoch, and what is derived from each frame
has its number. So a number that does not arrive is a frame that was not taken; whether its sender
never sent it, the sender's health says, in which each dropped frame is counted by reason. Keys that
have no sample for each frame, such as events, and those of other programs prove nothing.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from zenoh_vision.topics import topic_of
from zv.bag.record import Record

MAX_KEYS: Final = 10_000
MAX_EPOCHS: Final = 8
"""Epochs of a key whose numbers are followed; a source that is opened again begins another."""

MAX_GAPS: Final = 20
"""Gaps of a key that an account names; all are counted."""

FAR: Final = 1_000_000
"""A larger step forward is no loss: somebody sent a wrong number."""

NOT_RECEIVED: Final = "not_received"


@dataclass
class Epoch:
    """Numbers of one epoch of a key.

    Attributes:
        first: The first number of this account.
        last: The highest number so far.
        missing: How many below it did not arrive, of this account.
        gaps: The first and last number of gaps that are still open.
    """

    first: int
    last: int
    missing: int = 0
    gaps: list[tuple[int, int]] = field(default_factory=list)


@dataclass
class KeyAccount:
    """What became of the samples on one key since the last account."""

    taken: int = 0
    bytes: int = 0
    repeated: int = 0
    unnumbered: int = 0
    sender: str = ""
    missed: Counter[str] = field(default_factory=Counter)
    epochs: OrderedDict[int, Epoch] = field(default_factory=OrderedDict)

    def to_map(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {
            "taken": self.taken,
            "bytes": self.bytes,
            "repeated": self.repeated,
            "unnumbered": self.unnumbered,
            "sender": self.sender,
            "missed": {name: count for name, count in self.missed.items() if count},
            "epochs": [
                {
                    "epoch": epoch,
                    "first": each.first,
                    "last": each.last,
                    "missing": each.missing,
                    "gaps": [list(gap) for gap in each.gaps[-MAX_GAPS:]],
                }
                for epoch, each in self.epochs.items()
                if each.first <= each.last
            ],
        }


class Ledger:
    """Counts what is taken and what is missed; ``account`` returns it and begins the next one."""

    def __init__(self) -> None:
        self._keys: dict[str, KeyAccount] = {}
        self._senders: dict[str, Counter[str]] = {}
        self._counters: dict[str, dict[str, int]] = {}
        self._notes: list[str] = []
        self.left_out = 0
        self.totals: Counter[str] = Counter()
        """``taken``, ``bytes`` and ``missed`` since the start."""

    def take(self, record: Record) -> None:
        """Count a published record that is to be written."""
        account = self._account(record.key)
        account.taken += 1
        account.bytes += len(record.payload)
        self.totals["taken"] += 1
        self.totals["bytes"] += len(record.payload)
        self._number(account, record)

    def miss(self, record: Record, reason: str) -> None:
        """Count a record that arrived and cannot be kept."""
        account = self._account(record.key)
        account.missed[reason] += 1
        self.totals["missed"] += 1
        self._number(account, record)

    def lose(self, records: Iterable[Record], reason: str) -> None:
        """Count records as missed that were taken since the last account, and not written."""
        for record in records:
            account = self._keys.get(record.key, KeyAccount())
            account.taken -= 1
            account.bytes -= len(record.payload)
            account.missed[reason] += 1
            self.totals["taken"] -= 1
            self.totals["bytes"] -= len(record.payload)
            self.totals["missed"] += 1

    def health(self, node: str, counters: Mapping[str, int]) -> None:
        """Note how many frames a node says that it dropped, by reason, since its start."""
        dropped = {name: count for name, count in counters.items() if name.startswith("dropped.")}
        known = self._counters.get(node)
        if known is None and len(self._counters) >= MAX_KEYS:
            return
        self._counters[node] = dropped
        if known is None or any(dropped.get(name, 0) < count for name, count in known.items()):
            return  # it begins, or was started again
        for name, count in dropped.items():
            if count > known.get(name, 0):
                found = self._senders.setdefault(node, Counter())
                found[name] += count - known.get(name, 0)

    def note(self, text: str) -> None:
        """Add a line to the account."""
        if text not in self._notes and len(self._notes) < 100:
            self._notes.append(text)

    def account(self, begin_ns: int, end_ns: int) -> dict[str, Any]:
        """Return the account of a time, for JSON, and begin the next one."""
        keys = {key: each.to_map() for key, each in self._keys.items() if each.taken or each.missed}
        senders = {node: dict(counts) for node, counts in self._senders.items()}
        found = {
            "begin_ns": begin_ns,
            "end_ns": end_ns,
            "keys": keys,
            "senders": senders,
            "notes": self._notes,
        }
        if self.left_out:
            found["left_out"] = self.left_out
        for key, each in self._keys.items():
            self._keys[key] = KeyAccount(
                sender=each.sender,
                epochs=OrderedDict(
                    (epoch, Epoch(numbers.last + 1, numbers.last, 0, numbers.gaps[-MAX_GAPS:]))
                    for epoch, numbers in each.epochs.items()
                ),
            )
        self._senders, self._notes, self.left_out = {}, [], 0
        return found

    def forget(self) -> None:
        """Forget all numbers: what comes next does not continue what was taken."""
        self._keys, self._senders, self._notes = {}, {}, []

    def resume(self, accounts: Iterable[Mapping[str, Any]]) -> None:
        """Continue after the accounts of a file, with the numbers that they end with."""
        for account in accounts:
            for key, fields in account["keys"].items():
                found = self._account(key)
                for each in fields["epochs"]:
                    found.epochs[each["epoch"]] = Epoch(each["last"] + 1, each["last"])

    def _account(self, key: str) -> KeyAccount:
        found = self._keys.get(key)
        if found is None:
            if len(self._keys) >= MAX_KEYS:
                self.left_out += 1
                return KeyAccount()
            found = self._keys[key] = KeyAccount()
        return found

    def _number(self, account: KeyAccount, record: Record) -> None:
        epoch, seq = record.number("epoch"), record.number("seq")
        topic = topic_of(record.key)
        if epoch is None or seq is None or topic is None or not topic.every_frame:
            account.unnumbered += 1
            return
        sender = record.header.get("node")
        account.sender = sender[:128] if isinstance(sender, str) else account.sender
        numbers = account.epochs.get(epoch)
        if numbers is None:
            # A source that is opened again begins with 0; what came before the recording did not
            # belong to it.
            missing = seq if account.epochs and seq < FAR else 0
            account.epochs[epoch] = numbers = Epoch(seq, seq)
            self._open_gap(account, numbers, seq - missing, seq - 1)
            while len(account.epochs) > MAX_EPOCHS:
                account.epochs.popitem(last=False)
        elif seq > numbers.last:
            if seq - numbers.last <= FAR:
                self._open_gap(account, numbers, numbers.last + 1, seq - 1)
            numbers.last = seq
        else:
            self._late(account, numbers, seq)

    def _open_gap(self, account: KeyAccount, numbers: Epoch, first: int, last: int) -> None:
        if last < first:
            return
        count = last - first + 1
        numbers.missing += count
        numbers.gaps.append((first, last))
        account.missed[NOT_RECEIVED] += count
        self.totals["missed"] += count
        del numbers.gaps[: -MAX_GAPS * 5]

    def _late(self, account: KeyAccount, numbers: Epoch, seq: int) -> None:
        """Note a number that is not above all before it: it closes a gap, or is a repetition."""
        for index, (first, last) in enumerate(numbers.gaps):
            if first <= seq <= last:
                parts = [(first, seq - 1), (seq + 1, last)]
                numbers.gaps[index : index + 1] = [each for each in parts if each[0] <= each[1]]
                numbers.missing -= 1
                account.missed[NOT_RECEIVED] -= 1
                self.totals["missed"] -= 1
                return
        account.repeated += 1
