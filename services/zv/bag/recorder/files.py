"""Writes records into the files of a plan: chunks in time, accounts, rotation, a failing disk."""

from __future__ import annotations

import json
import logging
import socket
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from zv.bag.derived import add_derived
from zv.bag.record import ChunkLost, Record, RecordingError, TooManyKeys
from zv.bag.recorder.ledger import Ledger
from zv.bag.recorder.plan import Plan
from zv.bag.recorder.series import Series
from zv.bag.recorder.syncer import Syncer, said
from zv.bag.ros2.profile import PROFILE, add_ros2, has_ros2
from zv.bag.samples import LogClock
from zv.bag.schemas import ACCOUNT
from zv.bag.writer import Writer

log = logging.getLogger("recorder")

FLUSH_S: Final = 0.5
"""A chunk is closed after this time, and the disk told to keep it: what is not yet in a chunk is
lost when the process dies."""

MAX_CLOSING: Final = 4
"""Files that wait for the disk to be closed; the one that is written is then not split."""

ACCOUNT_S: Final = 60.0
ACCOUNT_TOPIC: Final = "zenoh_vision/account"
HOLD_S: Final = 5.0
"""A failure is reported for this time after the last loss: small chunks may fit where others do
not."""

RETRY_S: Final = 2.0
"""After this time, a disk that failed is tried again; what comes until then is missed."""


class Files:
    """Writes records into one file after the other; never raises for a failing disk.

    Each begins with the records that ``state`` returns, and says ``about`` about itself.

    Attributes:
        failure: Why nothing can be written at present; empty if it can.
        paths: The files that are closed.
        ledger: The account of what is taken and missed.
    """

    def __init__(
        self,
        plan: Plan,
        about: Mapping[str, str],
        state: Callable[[], Iterable[Record]],
        clock: LogClock,
    ) -> None:
        self._plan, self._about, self._state, self._clock = plan, about, state, clock
        self._series = Series(plan)
        self.ledger = Ledger()
        self.failure = ""
        self.paths: list[Path] = []
        self.written_bytes = 0
        self._writer: Writer | None = None
        self._accounts: list[dict[str, Any]] = []
        self._is_between = self._is_full = False
        self._begun_s = self._flushed_s = self._account_s = self._failed_s = self._lost_s = -1e9
        self._account_ns = self._last_ns = 0
        self._syncer: Syncer | None = None
        self._closing: list[Syncer] = []

    @property
    def writing(self) -> Path | None:
        """The name that the file gets that is being written; None if none is."""
        return None if self._writer is None else self._writer.path

    def open(self, label: str = "", begin_ns: int | None = None) -> None:
        """Begin a file, with the state of the system.

        Args:
            label: A word for its name.
            begin_ns: When the first record arrived; None if it follows those of the file before.

        Raises:
            RecordingError: It cannot be made.
        """
        folder = self._plan.output.parent
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(f"cannot make the folder {folder}: {error.strerror}") from None
        self._make_room()
        about = {
            **self._about,
            "begun_ns": str(time.time_ns()),
            "host": socket.gethostname(),
            "keys": " ".join(self._plan.keys) or "default",
            "exclude": " ".join(self._plan.exclude),
        }
        self._writer = Writer(
            self._series.next_path(label), about, mode=self._plan.mode, profile=self._plan.profile
        )
        self._begun_s = self._flushed_s = self._account_s = time.monotonic()
        if begin_ns is not None:
            self.ledger.forget()
        self._account_ns = begin_ns or self._last_ns or self._clock.now_ns()
        self._syncer = Syncer(self._writer)
        self._is_full = False
        for record in self._state():
            self._add(replace(record, log_time_ns=self._account_ns, origin="query"))

    def failed(self, error: RecordingError) -> None:
        """Note that a file cannot be made, which is tried again."""
        if self.failure != str(error):
            log.error("%s; tried again every %g s", error, RETRY_S)
        self.failure, self._failed_s = str(error), time.monotonic()

    @property
    def is_retry_due(self) -> bool:
        """Whether to try again to make a file that could not be made."""
        return time.monotonic() - self._failed_s >= RETRY_S

    def add(self, record: Record) -> None:
        """Write a record, or count it as missed."""
        if self._plan.profile == PROFILE and not has_ros2(record):
            return
        if self._writer is None and not self._may_open():
            if record.origin == "stream":
                self.ledger.miss(record, "not_written")
            return
        self._last_ns = record.log_time_ns
        if record.origin == "stream":
            self.ledger.take(record)
        self._add(record)
        self._keep(time.monotonic())  # not only when all that waits is written

    def _add(self, record: Record) -> None:
        assert self._writer is not None
        try:
            add_record(self._writer, record, self._plan.profile)
        except ChunkLost as error:
            self._fail(error)
        except TooManyKeys as error:
            if record.origin == "stream":
                self.ledger.lose([record], "too_many_keys")
            if not self._is_full:
                self._is_full = True
                log.error("%s: what comes on further ones is missed", error)

    def tick(self) -> None:
        """Do what is due: close the chunk, write the account, begin another file."""
        self._note_closed()
        if self._writer is None:
            return
        now_s = time.monotonic()
        if now_s - self._account_s >= ACCOUNT_S:
            self._write_account()
        self._keep(now_s)
        if self._is_due(now_s):
            self.close()
            self._is_between = True  # the next record begins the next file

    def _keep(self, now_s: float) -> None:
        """Close the chunk and have the disk keep it, if it is time."""
        if self._writer is None or self._syncer is None or now_s - self._flushed_s < FLUSH_S:
            return
        self._flushed_s = now_s
        if self._writer.pending_bytes:  # that nothing can be written says nothing of the disk
            self._attempt(self._writer.flush)
        self._syncer.sync()
        if self._syncer.failure and not self.failure:
            self.failure = f"cannot write {self._plan.output}: {self._syncer.failure}"
            log.error("%s", self.failure)
        self._make_room()

    def close(self) -> None:
        """Write the end of the file, and have it closed; ``paths`` has it when it is."""
        writer, syncer = self._writer, self._syncer
        if writer is None or syncer is None:
            return
        self._write_account()
        self._writer = self._syncer = None
        self._closing.append(syncer)
        self._attempt(writer.flush)
        try:
            writer.finish({"ended_ns": str(time.time_ns()), "how": "closed"})
        except (OSError, ChunkLost) as error:
            self._note_unclosed(writer, said(error))
            syncer.end(is_complete=False)
        else:
            syncer.end(is_complete=True)
        self.written_bytes += writer.size

    def stop(self) -> None:
        """Close the file, wait until all are closed, and delete what is then over the limit."""
        self.close()
        for each in self._closing:
            each.wait()
        self._note_closed()
        self._series.make_room(self.paths[-1:])

    def _note_closed(self) -> None:
        """Note the files that were closed meanwhile, in their order."""
        while self._closing and self._closing[0].has_ended:
            ended = self._closing.pop(0)
            if ended.path is not None:
                self.paths.append(ended.path)
            elif ended.failure:
                self._note_unclosed(ended.writer, ended.failure)

    def _note_unclosed(self, writer: Writer, why: str) -> None:
        self.failure, self._lost_s = f"cannot close {writer.partial}: {why}", time.monotonic()
        log.error("%s; `zv bag repair` completes it", self.failure)

    def _make_room(self) -> None:
        writers = [each.writer for each in self._closing]
        writers += [] if self._writer is None else [self._writer]
        self._series.make_room([name for each in writers for name in (each.path, each.partial)])

    @property
    def size(self) -> int:
        """Bytes that were written, of all files."""
        return self.written_bytes + (0 if self._writer is None else self._writer.size)

    def _is_due(self, now_s: float) -> bool:
        assert self._writer is not None
        if self._plan.last_s or len(self._closing) >= MAX_CLOSING:
            return False
        size, age_s = self._plan.split_bytes, self._plan.split_s
        is_large = size is not None and self._writer.size + self._writer.pending_bytes >= size
        return is_large or (age_s is not None and now_s - self._begun_s >= age_s)

    def _write_account(self) -> None:
        """Write the account since the last one; one that is lost with its chunk is kept."""
        writer = self._writer
        assert writer is not None
        self._attempt(writer.flush)
        now_ns = max(self._account_ns, self._last_ns)
        step_ns = self._clock.step_ns()
        if abs(step_ns) > 1_000_000_000:
            self.ledger.note(f"the wall clock was set by {step_ns / 1e9:+.3f} s since the begin")
        self._accounts.append(self.ledger.account(self._account_ns, now_ns))
        self._account_ns, self._account_s = now_ns, time.monotonic()
        try:
            for account in self._accounts:
                add_account(writer, account, self._plan.profile)
            writer.flush()
        except (ChunkLost, OSError) as error:
            self._note_failure(error.cause if isinstance(error, ChunkLost) else error)
        else:
            self._accounts = []

    def _attempt(self, write: Callable[[], object]) -> None:
        try:
            write()
        except ChunkLost as error:
            self._fail(error)
        else:
            held = time.monotonic() - self._lost_s < HOLD_S
            is_synced = self._syncer is None or not self._syncer.failure
            if self.failure and is_synced and not held:
                log.warning("%s can be written again", self._plan.output)
                self.failure = ""

    def _fail(self, error: ChunkLost) -> None:
        published = [each for each in error.records if each.origin == "stream"]
        self.ledger.lose(published, f"disk: {error}")
        self._note_failure(error.cause)

    def _note_failure(self, error: OSError) -> None:
        text = f"cannot write {self._plan.output}: {said(error)}"
        if text != self.failure:
            log.error("%s; what arrives until it can be written again is missed", text)
        self.failure, self._lost_s = text, time.monotonic()

    def _may_open(self) -> bool:
        """Begin the next file, if it is time; after a failure, try so from time to time."""
        if not self._is_between and not (self.failure and self.is_retry_due):
            return False
        self._is_between = False
        try:
            self.open()
        except RecordingError as error:
            self.failed(error)
            return False
        self.failure = ""
        return True


def add_record(writer: Writer, record: Record, profile: str) -> bool:
    """Add a sample to a file; return whether it has a message for it, which ROS may not.

    Raises:
        ChunkLost: As for ``Writer.add_message``.
    """
    if profile == PROFILE:
        return add_ros2(writer, record)
    writer.add(record)
    add_derived(writer, record)
    return True


def add_account(writer: Writer, account: Mapping[str, Any], profile: str) -> None:
    """Add an account to a file: a message, or metadata where all messages are those of ROS.

    Raises:
        ChunkLost: As for ``Writer.add_message``.
        OSError: The disk failed.
    """
    data = json.dumps(account, separators=(",", ":"))
    if profile == PROFILE:  # ros2 bag reads no file with a channel of another encoding
        writer.add_metadata(ACCOUNT.name, {"json": data})
    else:
        at_ns = account["end_ns"]
        writer.add_message(ACCOUNT_TOPIC, ACCOUNT, (data.encode(),), at_ns, at_ns)
