"""``Recorder``: subscribes, keeps or writes what arrives, and counts what it could not."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import msgpack
import zenoh

from zenoh_vision import keys
from zenoh_vision.errors import PayloadError
from zenoh_vision.message_codec import unpack
from zenoh_vision.messages import Diagnostics
from zenoh_vision.transport.link import Link
from zv.bag.record import Record, RecordingError
from zv.bag.recorder.black_box import Memory, Triggers
from zv.bag.recorder.files import Files
from zv.bag.recorder.plan import MAX_REASON, Plan
from zv.bag.recorder.queue import RecordQueue
from zv.bag.recorder.selection import Subscriptions, default_keys, found_keys, system_keys
from zv.bag.recorder.system import SystemState
from zv.bag.samples import LogClock, record_of

log = logging.getLogger("recorder")

POLL_S: Final = 0.1
KEPT_QUEUE_BYTES: Final = 64 << 20
"""Limit of the queue beside the last seconds, which have the rest of the memory."""

SILENT_S: Final = 5.0
"""A disk is too slow if one write takes this long."""

HOLD_S: Final = 5.0
"""How long it is called too slow after the last sample that did not fit into the queue."""

LONGEST_S: Final = 600.0
"""Triggers that follow each other prolong one file up to this; the next one begins another."""


@dataclass(frozen=True)
class Progress:
    """How a recording goes.

    Attributes:
        taken: Samples that were recorded.
        missed: Samples that are known not to be recorded.
        size: Bytes of all files.
        writing: The file that is being written.
        failure: Why nothing can be written.
        delay: Why samples wait or are missed although nothing has failed.
    """

    taken: int
    missed: int
    size: int
    writing: Path | None
    failure: str
    delay: str


class Recorder:
    """Records by a plan, between ``start`` and ``stop``.

    Its name is that in triggers by query, and in the files. ``done`` is called on its thread with
    the path of each file that was closed. One that is patient tries again if the first file cannot
    be made.
    """

    def __init__(
        self,
        link: Link,
        namespace: str,
        plan: Plan,
        name: str,
        done: Callable[[Path], None] = lambda _: None,
        *,
        is_patient: bool = False,
    ) -> None:
        self._link, self._namespace, self._plan, self._name = link, namespace, plan, name
        self._done, self._is_patient = done, is_patient
        self._clock = LogClock()
        # What is kept in memory anyway leaves the queue at once.
        most = min(plan.memory_bytes, KEPT_QUEUE_BYTES) if plan.last_s else plan.memory_bytes
        self._queue = RecordQueue(most)
        exclude = tuple(each.removeprefix("/") for each in plan.exclude)
        self._subscriptions = Subscriptions(link, exclude, self._receive)
        self._system = SystemState(
            link, namespace, exclude, self._clock, self._queue.put, self._subscribe_found
        )
        about = {"namespace": namespace, "recorder": name}
        self._files = Files(plan, about, self._system.records, self._clock)
        self._memory = Memory(plan.last_s, plan.memory_bytes) if plan.last_s else None
        self._triggers = Triggers(plan.on_event, plan.on_level, namespace, name)
        self._until_s = self._latest_s = self._given_up_s = 0.0
        self._unwritten = ""
        """Why the last seconds are to be written, while no file can be made for them."""
        self._health_prefix = keys.diagnostics_key(namespace, "")
        self._told = 0
        self._alive_s = time.monotonic()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)

    @property
    def keys(self) -> tuple[str, ...]:
        """The key expressions that it subscribes to."""
        return self._subscriptions.keys

    @property
    def paths(self) -> list[Path]:
        """The files that are closed."""
        return list(self._files.paths)

    def progress(self) -> Progress:
        """Return how it goes."""
        files, totals = self._files, self._files.ledger.totals
        # In this order: what the ledger takes over meanwhile is not counted twice.
        missed = totals["missed"] + self._queue.lost
        return Progress(
            totals["taken"], missed, files.size, files.writing, files.failure, self._delay()
        )

    def _delay(self) -> str:
        """Return how the disk is too slow, in words; empty if it is not."""
        now_s = time.monotonic()
        silent_s = now_s - self._alive_s
        found = []
        if silent_s > SILENT_S:
            found.append(f"has taken nothing for {silent_s:.0f} s")
        if now_s - self._queue.lost_s < HOLD_S:
            found.append("is too slow: what does not fit into memory_mb is missed")
        return f"the disk of {self._plan.output} {', and '.join(found)}" if found else ""

    def start(self) -> None:
        """Begin to record.

        Raises:
            RecordingError: The file cannot be made, and it is not patient.
        """
        if self._memory is None:
            try:
                self._files.open()
            except RecordingError as error:
                if not self._is_patient:
                    raise
                self._files.failed(error)
        for each in self._plan.keys or default_keys(self._namespace):
            self._subscriptions.add(each)
        for each in system_keys(self._namespace):
            self._subscriptions.add(each)
        self._system.start()
        if self._memory is not None:
            key = keys.record_key(self._namespace, self._name)
            self._link.declare(lambda session: session.declare_queryable(key, self._answer))
        self._thread.start()

    def trigger(self, reason: str = "command") -> None:
        """Have the last seconds written; safe in a signal handler and on any thread."""
        self._triggers.ask(reason)

    def stop(self) -> None:
        """End the subscriptions, write what waits, and close the file."""
        self._subscriptions.close()
        self._system.close()
        self._ended.set()
        self._thread.join()

    def _subscribe_found(self, published: Iterable[str]) -> None:
        if not self._plan.keys:
            for key in found_keys(self._namespace, published):
                self._subscriptions.add(key)

    def _receive(self, sample: zenoh.Sample) -> None:
        self._queue.put(record_of(sample, self._clock.now_ns()))

    def _answer(self, query: zenoh.Query) -> None:
        """Answer a query that triggers, whose payload may be a reason: ``{"reason": "..."}``."""
        why = "query"
        try:
            fields = unpack(query.payload.to_bytes()) if query.payload is not None else None
            if isinstance(fields, dict) and isinstance(fields.get("reason"), str):
                why = fields["reason"][:MAX_REASON] or why
        except PayloadError:
            pass
        self._triggers.ask(why)
        folder = str(self._plan.output.parent.absolute())
        reply = msgpack.packb({"recorder": self._name, "reason": why, "folder": folder})
        key = keys.record_key(self._namespace, self._name)
        query.reply(key, reply, encoding="application/msgpack")

    def _run(self) -> None:
        while True:
            self._alive_s = time.monotonic()
            is_last = self._ended.is_set()
            records = self._queue.take(0.0 if is_last else POLL_S)
            try:
                for record, fits in records:
                    if fits:
                        self._take(record)
                    else:
                        self._files.ledger.miss(record, "recorder_behind")
                self._tick()
            except Exception:
                log.exception("the recorder cannot go on as it should")
            self._queue.done(records)
            if is_last:
                break
        self._files.stop()
        self._tell()

    def _take(self, record: Record) -> None:
        self._alive_s = time.monotonic()
        if record.key.startswith(self._health_prefix):
            self._note_health(record)
        if record.origin == "stream":
            self._system.update(record)
        if self._memory is None:
            self._files.add(record)
            return
        reason = self._triggers.reason(record)
        if reason:
            self._begin(reason)
        self._memory.add(record)
        if self._files.writing is not None:
            self._files.add(record)

    def _tick(self) -> None:
        if self._memory is not None:
            while reason := self._triggers.asked():
                self._begin(reason)
            if self._unwritten and (self._ended.is_set() or self._files.is_retry_due):
                self._write_last()
            if self._files.writing is not None and time.monotonic() > self._until_s:
                self._files.close()
        self._files.tick()
        self._tell()

    def _tell(self) -> None:
        """Say which files were closed since the last time."""
        for path in self._files.paths[self._told :]:
            self._told += 1
            log.info("wrote %s", path)
            self._done(path)

    def _begin(self, reason: str) -> None:
        """Write the last seconds and those that follow, or prolong the file that is written."""
        now_s = time.monotonic()
        # While the memory has the moment, a file that could not be made is worth another attempt.
        self._given_up_s = now_s + max(self._plan.after_s, self._plan.last_s or 0.0)
        if self._files.writing is not None or self._unwritten:
            self._until_s = min(now_s + self._plan.after_s, self._latest_s)
            return
        self._until_s = now_s + self._plan.after_s
        self._latest_s = now_s + LONGEST_S
        self._unwritten = reason
        self._write_last()

    def _write_last(self) -> None:
        """Begin the file of the last seconds; one that cannot be made is tried again."""
        assert self._memory is not None
        reason = self._unwritten
        try:
            self._files.open(reason, self._memory.begin_ns or self._clock.now_ns())
        except RecordingError as error:
            self._files.failed(error)
            if time.monotonic() > self._given_up_s:
                log.error("%s: nothing was written of it: %s", reason, error)
                self._unwritten = ""
            return
        self._unwritten = self._files.failure = ""
        log.info("%s: writes %s", reason, self._files.writing)
        if self._memory.shortened is not None:
            self._files.ledger.note(
                f"the memory is full after {self._memory.shortened:.1f} s: less than asked for"
            )
        for record in self._memory:
            self._files.add(record)

    def _note_health(self, record: Record) -> None:
        try:
            health = Diagnostics.from_bytes(record.payload)
        except PayloadError:
            return
        self._files.ledger.health(health.node, health.counters)
