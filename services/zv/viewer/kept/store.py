"""Keeps events and their pictures in one SQLite file, bounded in age, number and bytes."""

from __future__ import annotations

import json
import logging
import os
import sqlite3
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

from zenoh_vision.messages import Box, TrackEvent

log = logging.getLogger("viewer")

MOST_EVENTS: Final = 100_000
REMOVED_AT_ONCE: Final = 100
WAIT_S: Final = 2.0
"""How long another viewer may use the file before that is an error."""

LONGEST_NAME: Final = 100
LARGEST: Final = 2**63 - 1
DAMAGES: Final = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)

COLUMNS: Final = (
    *("number", "stamp_ns", "camera", "kind", "zone", "direction", "track", "class"),
    *("x", "y", "width", "height", "epoch", "seq", "picture", "frames_later", "box"),
)

TABLES: Final = """
CREATE TABLE IF NOT EXISTS pictures(number INTEGER PRIMARY KEY AUTOINCREMENT, jpeg BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS events(
    number INTEGER PRIMARY KEY AUTOINCREMENT, kept_ns INTEGER, stamp_ns INTEGER, camera TEXT,
    kind TEXT, zone TEXT, direction TEXT, track INTEGER, class TEXT, x REAL, y REAL,
    width INTEGER, height INTEGER, epoch INTEGER, seq INTEGER, picture INTEGER,
    frames_later INTEGER, box TEXT,
    UNIQUE(camera, epoch, seq, kind, track, zone, direction));
CREATE INDEX IF NOT EXISTS by_age ON events(kept_ns);
CREATE INDEX IF NOT EXISTS by_picture ON events(picture);
"""
UNUSED_PICTURES: Final = (
    "DELETE FROM pictures WHERE number < ifnull((SELECT min(picture) FROM events), number + 1)"
)

T = TypeVar("T")


class EventsUnavailable(Exception):
    """The file cannot be used now; the text says why."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A small picture, which several events may have."""

    jpeg: bytes


@dataclass(frozen=True, slots=True)
class Seen:
    """An event and what was seen of it.

    Attributes:
        event: As it arrived.
        picture: None without one.
        frames_later: By how many frames the picture is later than the event's; None if they are of
            different epochs.
        box: Of the track; None if the tracker does not say it.
    """

    event: TrackEvent
    picture: Picture | None = None
    frames_later: int | None = None
    box: Box | None = None


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which events are wanted; None for all. ``before`` and ``after`` are numbers of events."""

    camera: str | None = None
    kind: str | None = None
    zone: str | None = None
    since_ns: int | None = None
    until_ns: int | None = None
    before: int | None = None
    after: int | None = None

    def where(self) -> tuple[str, list[object]]:
        """Return the condition in SQL and its values."""
        terms = {
            "camera = ?": self.camera,
            "kind = ?": self.kind,
            "zone = ?": self.zone,
            "stamp_ns >= ?": self.since_ns,
            "stamp_ns < ?": self.until_ns,
            "number < ?": self.before,
            "number > ?": self.after,
        }
        given = {term: value for term, value in terms.items() if value is not None}
        return " AND ".join(given) or "1", list(given.values())


class EventStore:
    """One file, whose folder is made; safe between threads, and between viewers that share it.

    Attributes:
        fault: Why events are not kept; empty if they are.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.fault = ""
        self._moved = ""
        self._opened: sqlite3.Connection | None = None
        self._lock = threading.Lock()

    def add(self, seen: Sequence[Seen], keep_s: float, most_bytes: int) -> bool:
        """Keep events, and remove those beyond the limits; return whether that was possible."""

        def work(database: sqlite3.Connection) -> None:
            now_ns = time.time_ns()
            numbers: dict[Picture, int] = {}
            for each in seen:
                _insert(database, each, now_ns, numbers)
            _remove(database, now_ns - int(keep_s * 1e9), most_bytes)

        try:
            self._do(work)
        except EventsUnavailable:
            return False
        self.fault = self._moved
        return True

    def find(self, wanted: Wanted, most: int) -> list[dict[str, Any]]:
        """Return the newest wanted events, newest first.

        Raises:
            EventsUnavailable: The file cannot be read.
        """
        where, values = wanted.where()
        text = (
            f"SELECT {', '.join(COLUMNS)} FROM events WHERE {where} "  # noqa: S608 - our own words
            "ORDER BY number DESC LIMIT ?"
        )
        rows = self._do(lambda database: database.execute(text, [*values, most]).fetchall())
        found = [dict(zip(COLUMNS, row, strict=True)) for row in rows]
        return [each | {"box": json.loads(each["box"] or "null")} for each in found]

    def choices(self) -> dict[str, list[str]]:
        """Return the cameras, kinds and zones of the kept events; raises as ``find``."""

        def work(database: sqlite3.Connection) -> dict[str, list[str]]:
            text = "SELECT DISTINCT {0} FROM events WHERE {0} > '' ORDER BY 1 LIMIT 500"
            return {
                name: [row[0] for row in database.execute(text.format(name))]
                for name in ("camera", "kind", "zone")
            }

        return self._do(work)

    def picture(self, number: int) -> bytes | None:
        """Return the JPEG of a number; None if there is none. Raises as ``find``."""
        text = "SELECT jpeg FROM pictures WHERE number = ?"
        row = self._do(lambda database: database.execute(text, [number]).fetchone())
        return None if row is None else bytes(row[0])

    def moment(self, number: int) -> tuple[str, int] | None:
        """Return an event's camera, and when it was kept, ns since 1970. Raises as ``find``."""
        text = "SELECT camera, kept_ns FROM events WHERE number = ?"
        row = self._do(lambda database: database.execute(text, [number]).fetchone())
        return None if row is None else (row[0], row[1])

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._forget()

    def _do(self, work: Callable[[sqlite3.Connection], T]) -> T:
        """Do something in a transaction.

        Raises:
            EventsUnavailable: It failed, and nothing was changed.
        """
        with self._lock:
            try:
                database = self._database()
                with database:
                    return work(database)
            except (sqlite3.Error, OSError) as error:
                raise EventsUnavailable(self._failed(error)) from None

    def _database(self) -> sqlite3.Connection:
        if self._opened is None:
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            os.close(os.open(self.path, os.O_RDWR | os.O_CREAT, 0o600))
            database = sqlite3.connect(self.path, timeout=WAIT_S, check_same_thread=False)
            self._opened = database
            os.chmod(self.path, 0o600)
            database.execute("PRAGMA auto_vacuum = FULL")
            database.execute("PRAGMA synchronous = NORMAL")
            database.executescript(TABLES)
        return self._opened

    def _failed(self, error: Exception) -> str:
        self._forget()
        said = error.strerror if isinstance(error, OSError) else str(error)
        self.fault = f"events are not kept: {self.path}: {said}"
        if getattr(error, "sqlite_errorcode", 0) & 0xFF in DAMAGES:
            aside = self.path.with_suffix(".damaged")
            try:
                self.path.replace(aside)
            except OSError:
                return self.fault
            self._moved = (
                f"{self.path} was damaged ({said}) and is now {aside.name}; a new one is used"
            )
            self.fault = self._moved
        return self.fault

    def _forget(self) -> None:
        if self._opened is not None:
            self._opened.close()
            self._opened = None


def _insert(
    database: sqlite3.Connection, seen: Seen, now_ns: int, numbers: dict[Picture, int]
) -> None:
    """Insert an event, unless it has arrived before; ``numbers`` are those of stored pictures."""
    event, header = seen.event, seen.event.header
    stamp_ns = header.stamp_ns if event.stamp_ns is None else event.stamp_ns
    zone, direction = ((name or "")[:LONGEST_NAME] for name in (event.zone, event.direction))
    later = seen.frames_later
    values = {
        "kept_ns": now_ns,
        "stamp_ns": stamp_ns,
        "camera": header.camera,
        "kind": event.event,
        "zone": zone,
        "direction": direction,
        "track": min(event.id, LARGEST),
        "class": event.class_name,
        "x": event.x,
        "y": event.y,
        "width": header.width,
        "height": header.height,
        "epoch": header.epoch,
        "seq": min(header.seq, LARGEST),
        "frames_later": None if later is None else max(-LARGEST, min(later, LARGEST)),
        "box": None if seen.box is None else json.dumps(seen.box),
    }
    marks = ", ".join("?" * len(values))
    text = f"INSERT OR IGNORE INTO events({', '.join(values)}) VALUES({marks})"
    inserted = database.execute(text, list(values.values()))
    picture = seen.picture
    if not inserted.rowcount or picture is None:
        return
    if picture not in numbers:
        put = database.execute("INSERT INTO pictures(jpeg) VALUES(?)", [picture.jpeg])
        numbers[picture] = put.lastrowid or 0
    text = "UPDATE events SET picture = ? WHERE number = ?"
    database.execute(text, (numbers[picture], inserted.lastrowid))


def _remove(database: sqlite3.Connection, oldest_ns: int, most_bytes: int) -> None:
    text = "DELETE FROM events WHERE kept_ns < ? OR number <= (SELECT max(number) FROM events) - ?"
    database.execute(text, (oldest_ns, MOST_EVENTS))
    database.execute(UNUSED_PICTURES)
    first = "DELETE FROM events WHERE number IN (SELECT number FROM events ORDER BY 1 LIMIT ?)"
    while (
        _used_bytes(database) > most_bytes and database.execute(first, [REMOVED_AT_ONCE]).rowcount
    ):
        database.execute(UNUSED_PICTURES)


def _used_bytes(database: sqlite3.Connection) -> int:
    pages, free, size = (
        database.execute(f"PRAGMA {name}").fetchone()[0]
        for name in ("page_count", "freelist_count", "page_size")
    )
    return int((pages - free) * size)
