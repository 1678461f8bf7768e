"""The tracks of every frame of a file, as a table: CSV, or the format of MOTChallenge."""

from __future__ import annotations

import csv
import logging
import os
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any, Final

import zenoh
from rich.console import Console
from rich.status import Status

from zenoh_vision.config.constraints import toml_line
from zenoh_vision.config.settings import local_path
from zenoh_vision.errors import (
    ConfigurationError,
    ExpectationNotMet,
    PayloadError,
    SourceError,
)
from zenoh_vision.host.signals import StopSignals
from zenoh_vision.messages import Centroid, Tracks
from zenoh_vision.topics import CENTROID, TRACKS
from zenoh_vision.transport.query import Query, ask, messages_in
from zenoh_vision.transport.router import private_router
from zenoh_vision.transport.session import direct
from zv.bag.private_system import Child, zv_command
from zv.tracker.settings import TrackerSettings

log = logging.getLogger(__name__)

CSV: Final = ".csv"
MOT: Final = ".txt"
NAMESPACE: Final = "track"
POLL_S: Final = 0.05
LATE_S: Final = 5.0
"""How long the last results may take after the camera has ended."""

COLUMNS: Final = (
    *("frame", "time_s", "id", "state", "x", "y", "left", "top", "width", "height", "area"),
    *("vx", "vy", "age_s", "missing_s", "world_x", "world_y", "class", "score"),
)
PARTIAL: Final = ".partial"


def write_table(settings: TrackerSettings, file: str, out: str) -> None:
    """Track the objects in a file, and write a row for each object of each frame.

    Args:
        settings: Of the tracker.
        file: A video, a recording or a folder of images.
        out: The table; it gets its name when it is complete.

    Raises:
        ConfigurationError: The name of the table has another ending, or there are several cameras.
        ExpectationNotMet: The tracker or the camera ended, or told to stop.
        SourceError: The file cannot be read, or the table cannot be written.
    """
    path = Path(out)
    if path.suffix.lower() not in (CSV, MOT):
        raise ConfigurationError(f"--out {out}: allowed: a name that ends in {CSV} or {MOT}")
    if len(settings.cameras) != 1:
        raise ConfigurationError(f"--camera {settings.camera}: a file is of one camera; name it")
    partial = path.with_name(path.name + PARTIAL)
    try:
        with StopSignals() as signals, _opened(partial) as written:
            table = Table(written, mot=path.suffix.lower() == MOT)
            _track(settings, file, table, lambda: signals.stopping)
        if signals.stopping:
            raise ExpectationNotMet(f"told to stop after {table.frames} frames; nothing is written")
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    print(f"{path}: {table.frames} frames, {len(table.ids)} objects, {table.rows} rows", flush=True)


class Table:
    """Writes the rows of the frames, in their order."""

    def __init__(self, file: IO[str], *, mot: bool) -> None:
        self.frames = self.rows = 0
        self.ids: set[tuple[int, int]] = set()
        self.newest: tuple[int, int] | None = None
        self._mot = mot
        self._writer = csv.writer(file, lineterminator="\n")
        if not mot:
            self._writer.writerow(COLUMNS)

    def add(self, message: Tracks) -> None:
        """Write the rows of a frame."""
        header = message.header
        self.newest = header.epoch, header.seq
        self.frames += 1
        time_s = (header.stamp_ns - header.epoch) / 1e9
        for track in message.tracks:
            left, top, width, height = track.box
            if self._mot:
                if track.state != "confirmed":
                    continue
                row: list[Any] = [header.seq + 1, track.id, left, top, width, height, 1, -1, -1, -1]
            else:
                world = track.world or ("", "")
                row = [header.seq, f"{time_s:.6f}", track.id, track.state]
                row += [_short(track.x), _short(track.y), left, top, width, height]
                row += [_short(each) for each in (track.area, track.vx, track.vy)]
                row += [_short(track.age_s), _short(track.missing_s), *world]
                row += [track.class_name or "", "" if track.score is None else track.score]
            self.ids.add((header.epoch, track.id))
            self.rows += 1
            self._writer.writerow(row)


def _short(value: float) -> str:
    return f"{value:.6g}"


@contextmanager
def _opened(partial: Path) -> Iterator[IO[str]]:
    try:
        with partial.open("w", newline="") as file:
            yield file
    except OSError as error:
        raise SourceError(f"{partial}: cannot be written: {error.strerror or error}") from None


def _track(
    settings: TrackerSettings, file: str, table: Table, stopping: Callable[[], bool]
) -> None:
    """Run a camera and a tracker in lockstep, and pass the tracks on to a table."""
    name = settings.camera
    with ExitStack() as opening:
        session, endpoint = opening.enter_context(private_router())
        arrived = Arrivals(session, name)
        opening.callback(arrived.close)
        folder = opening.enter_context(TemporaryDirectory(prefix="zv-track-"))
        config = Path(folder) / "tracker.toml"
        values = settings.model_dump(exclude={"transport"}, exclude_none=True)
        for each, value in values.items():  # in a file, paths are relative to it
            if local_path(TrackerSettings, each, value):
                values[each] = str(Path(value).absolute())
        config.write_text("\n".join(toml_line(each, value) for each, value in values.items()))

        def start(*words: str) -> Child:
            return opening.enter_context(Child(zv_command(*words), endpoint, NAMESPACE))

        tracker = start("tracker", "--config", str(config))
        camera = start(
            *("camera", "--camera", name, "--source", file, "--lockstep", f"tracker_{name}")
        )
        console = Console(stderr=True)
        shown = Status("starting", console=console)
        if console.is_terminal:
            opening.enter_context(shown)
        while not stopping() and camera.status is None:
            tracker.check()
            arrived.pass_on(table)
            shown.update(f"{table.frames} frames, {len(table.ids)} objects")
            time.sleep(POLL_S)
        if stopping():
            return
        camera.check(expected=0)
        camera.pass_on_warnings()  # of what it could not read
        # It ended when the tracker had begun to answer the last frame: with the centroid.
        (replies,) = ask(session, [Query(CENTROID.key(NAMESPACE, name), timeout_s=LATE_S)])
        last = next((each.header for _, each in messages_in(replies, Centroid)), None)
        if last is None:
            raise ExpectationNotMet(f"{file}: the tracker answered no frame")
        until_s = time.monotonic() + LATE_S
        while table.newest != (last.epoch, last.seq):
            if time.monotonic() > until_s:
                raise ExpectationNotMet(f"{file}: the tracks of frame {last.seq} did not arrive")
            time.sleep(POLL_S)
            arrived.pass_on(table)


class Arrivals:
    """The tracks that have arrived, in order."""

    def __init__(self, session: zenoh.Session, camera: str) -> None:
        self._waiting: deque[bytes] = deque()  # filled by Zenoh's thread
        key = TRACKS.key(NAMESPACE, camera)
        self._declared = session.declare_subscriber(key, direct(self._note))

    def close(self) -> None:
        """End the subscription."""
        self._declared.undeclare()  # type: ignore[no-untyped-call]

    def pass_on(self, table: Table) -> None:
        """Add what has arrived since the last call to a table."""
        while self._waiting:
            try:
                table.add(Tracks.from_bytes(self._waiting.popleft()))
            except PayloadError as error:
                log.warning("%s", error)

    def _note(self, sample: zenoh.Sample) -> None:
        self._waiting.append(sample.payload.to_bytes())
