"""What a power cut can leave of the files in a folder, from a log of the calls that wrote them."""

from __future__ import annotations

import os
import random
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

SECTOR = 512
"""Bytes that a disk writes whole or not at all."""


@dataclass(frozen=True)
class Write:
    """Bytes that were written to a file at a place; none were written if the file was cut there."""

    file: int
    place: int
    data: bytes | None


@dataclass(frozen=True)
class Name:
    """A name that was given to a file, made from another one, or taken away."""

    new: str | None = None
    old: str | None = None
    file: int | None = None


@dataclass
class Sync:
    """A call that has the disk keep a file or the names in the folder; ``file`` is None for these.

    Attributes:
        begin: Its place in the log: what was written before is kept once it ended.
        end: Where in the log it ended; None while it goes on.
        thread: The thread that waits for the disk.
    """

    file: int | None
    begin: int
    end: int | None = None
    thread: int = field(default_factory=threading.get_ident)


class LoggedDisk:
    """Logs the calls that write files in a folder, all of which go on to the real disk.

    A sync does not go on to the disk, and waits while ``hold`` says so.
    """

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.log: list[Write | Name | Sync] = []
        """The calls in their order; a sync is there twice, at its begin and at its end."""
        self.syncs: list[Sync] = []
        self._folder = folder
        self._files: dict[int, int | None] = {}
        self._count = 0
        self._lock = threading.RLock()
        self._may_end = threading.Semaphore(0)
        self._is_held = False
        self._real = {name: getattr(os, name) for name in self._patches()}
        for name, patch in self._patches().items():
            monkeypatch.setattr(os, name, patch)
        for module in ("zv.bag.renaming",):
            monkeypatch.setattr(f"{module}.exclusively_renamed", self._exclusively_renamed)

    def _patches(self) -> dict[str, Any]:
        return {
            "open": self._open,
            "close": self._close,
            "pwritev": self._pwritev,
            "ftruncate": self._ftruncate,
            "fdatasync": self._sync,
            "fsync": self._sync,
            "unlink": self._unlink,
        }

    def hold(self) -> None:
        """Let no sync end, until ``end_one`` or ``release``."""
        self._is_held = True

    def end_one(self) -> None:
        """Let one sync end that waits, or else the next."""
        self._may_end.release()

    def release(self) -> None:
        """Let all syncs end."""
        self._is_held = False
        for _ in range(1000):
            self._may_end.release()

    def going_on(self) -> list[Sync]:
        """Return the syncs that wait for the disk."""
        with self._lock:
            return [each for each in self.syncs if each.end is None]

    def _open(self, path: Any, flags: int, mode: int = 0o777, **more: Any) -> int:
        with self._lock:
            opened: int = self._real["open"](path, flags, mode, **more)
            if Path(path) == self._folder:
                self._files[opened] = None
            elif Path(path).parent == self._folder and flags & os.O_CREAT:
                self._count += 1
                self._files[opened] = self._count
                self.log.append(Name(new=Path(path).name, file=self._count))
        return opened

    def _close(self, opened: int) -> None:
        with self._lock:
            self._files.pop(opened, None)
            self._real["close"](opened)

    def _pwritev(self, opened: int, buffers: Sequence[bytes], place: int) -> int:
        with self._lock:
            done: int = self._real["pwritev"](opened, buffers, place)
            file = self._files.get(opened)
            if file is not None:
                self.log.append(Write(file, place, b"".join(buffers)[:done]))
        return done

    def _ftruncate(self, opened: int, size: int) -> None:
        with self._lock:
            self._real["ftruncate"](opened, size)
            file = self._files.get(opened)
            if file is not None:
                self.log.append(Write(file, size, None))

    def _sync(self, opened: int) -> None:
        with self._lock:
            if opened not in self._files:
                return
            sync = Sync(self._files[opened], len(self.log))
            self.syncs.append(sync)
            self.log.append(sync)
        if self._is_held:
            self._may_end.acquire()
        with self._lock:
            self.log.append(sync)
            sync.end = len(self.log)

    def _unlink(self, path: Any, **more: Any) -> None:
        with self._lock:
            self._real["unlink"](path, **more)
            if Path(path).parent == self._folder:
                self.log.append(Name(old=Path(path).name))

    def _exclusively_renamed(self, source: Path, target: Path) -> None:
        with self._lock:
            assert not target.exists()
            os.rename(source, target)
            self.log.append(Name(new=target.name, old=source.name))

    def kept(self, cut: int, file: int | None) -> int:
        """Return up to where in the log the disk has what was done to a file, or to the folder."""
        ended = (each for each in self.syncs if each.end is not None and each.end <= cut)
        return max((each.begin for each in ended if each.file == file), default=0)

    def synced(self, cut: int) -> dict[int, int]:
        """Return the bytes that must be left when power is cut there, of each file with a name."""
        files = self._names(cut, 0.0, random.Random()).values()
        return {each: len(self.content(each, self.kept(cut, each))) for each in files}

    def content(self, file: int, end: int | None = None) -> bytes:
        """Return what a program reads from a file at a place in the log."""
        return _content(self._writes(file, 0, len(self.log) if end is None else end))

    def after_cut(self, cut: int, states: int, seed: int) -> Iterator[Mapping[str, bytes]]:
        """Yield what can be left, by name, when power is cut at a place in the log.

        What was synced is there. Of the rest there is first nothing, then all, then what chance
        says: each name, each size of a file, and each sector written, or zeros in its place.
        """
        chance = random.Random(f"{seed} {cut}")
        for number in range(states):
            odds = (0.0, 1.0)[number] if number < 2 else chance.choice((0.1, 0.5, 0.9))
            yield {
                name: self._left(file, cut, odds, chance)
                for name, file in self._names(cut, odds, chance).items()
            }

    def _names(self, cut: int, odds: float, chance: random.Random) -> dict[str, int]:
        kept, names = self.kept(cut, None), dict[str, int]()
        files: dict[str, int] = {}
        for number, each in enumerate(self.log[:cut]):
            if not isinstance(each, Name):
                continue
            file = files.get(each.old or "") if each.file is None else each.file
            if each.old is not None:
                files.pop(each.old, None)
            if each.new is not None:
                assert file is not None
                files[each.new] = file
            if number < kept or chance.random() < odds:
                if each.old is not None:
                    names.pop(each.old, None)
                if each.new is not None:
                    assert file is not None
                    names[each.new] = file
        return names

    def _left(self, file: int, cut: int, odds: float, chance: random.Random) -> bytes:
        kept = self.kept(cut, file)
        content = bytearray(_content(self._writes(file, 0, kept)))
        writes = list(self._writes(file, kept, cut))
        if not writes:
            return bytes(content)
        whole = _content(self._writes(file, 0, cut))
        size = chance.randint(len(content), max(len(whole), len(content)))
        size = {0.0: len(content), 1.0: len(whole)}.get(odds, size)
        content += bytes(max(0, size - len(content)))
        for each in writes:
            if each.data is None:
                del content[each.place :]
                continue
            end = min(each.place + len(each.data), len(content))
            for begin in range(each.place // SECTOR * SECTOR, end, SECTOR):
                part = slice(max(begin, each.place), min(begin + SECTOR, end))
                if chance.random() < odds:
                    content[part] = each.data[part.start - each.place : part.stop - each.place]
        return bytes(content)

    def _writes(self, file: int, begin: int, end: int) -> Iterator[Write]:
        for each in self.log[begin:end]:
            if isinstance(each, Write) and each.file == file:
                yield each


def _content(writes: Iterator[Write]) -> bytes:
    content = bytearray()
    for each in writes:
        if each.data is None:
            del content[each.place :]
        else:
            content += bytes(max(0, each.place - len(content)))
            content[each.place : each.place + len(each.data)] = each.data
    return bytes(content)
