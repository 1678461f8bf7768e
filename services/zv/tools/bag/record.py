"""``zv bag record``: records until Ctrl-C, or for a time; ``zv bag trigger`` has it write."""

from __future__ import annotations

import select
import signal
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import msgpack

from zenoh_vision import keys
from zenoh_vision.errors import ExpectationNotMet, PayloadError
from zenoh_vision.message_codec import unpack
from zenoh_vision.transport.connection import Connection
from zv.bag.recorder.recorder import Progress, Recorder
from zv.bag.recorder.selection import default_keys
from zv.bag.recording import Recording, matcher
from zv.bag.report import report_of
from zv.tools.bag.info import file_line
from zv.tools.bag.options import RecordOptions, TriggerOptions
from zv.tools.shared.discovery import discover
from zv.tools.shared.output import Output, view_of
from zv.tools.shared.session import ToolSession, key_expression

NAME = "bag_record"
PERIOD_S = 1.0
POLL_S = 0.1


def run(options: RecordOptions, connection: Connection, output: Output) -> None:
    """Record, and say at the end what was recorded and missed.

    Raises:
        ExpectationNotMet: Nothing arrived, something that arrived could not be written, or the
            credentials do not allow to receive it.
        RecordingError: The file cannot be made.
        ConfigurationError: A key expression is none, or an option needs ``--last``.
    """
    for each in (*options.keys, *options.exclude):
        key_expression(each)
    plan = options.plan()
    with ToolSession(connection) as session:
        for each in options.keys or default_keys(session.namespace):
            session.require("subscribe", key_expression(each))
        denial = session.denial("answer", keys.record_key(session.namespace, NAME))
        if options.last is not None and denial is not None:
            output.note(f"{denial}; so zv bag trigger does not reach it")
        paths: list[Path] = []
        recorder = Recorder(session.link, session.namespace, plan, NAME, paths.append)
        signal.signal(signal.SIGUSR1, lambda *_: recorder.trigger("signal"))
        recorder.start()
        output.note(_started(options))
        try:
            _wait(options, session, recorder, output)
        finally:
            recorder.stop()
            progress = recorder.progress()
        left = [path for path in paths if path.exists()]
        silence = ""
        if options.last is None and len(left) == len(paths) and not progress.failure:
            silence = _silence(options, session, left, output)
    if options.last and not paths and not progress.failure:
        output.note("nothing triggered it: no file was written")
    for path in left:
        _tell(path, output)
    if deleted := len(paths) - len(left):
        files = "older file was" if deleted == 1 else "older files were"
        output.note(f"{deleted} {files} deleted{' (--total-mb)' if options.total_mb else ''}")
    if progress.failure:
        raise ExpectationNotMet(f"{progress.failure}; {progress.missed} messages were missed")
    if silence:
        raise ExpectationNotMet(silence)


def _started(options: RecordOptions) -> str:
    end = f"for {options.for_:g} s" if options.for_ else "Ctrl-C ends it"
    if options.last is None:
        return f"recording into {options.output}; {end}"
    return (
        f"keeping the last {options.last:g} s for {options.output}; zv bag trigger, SIGUSR1 or "
        f"Enter writes them; {end}"
    )


def _wait(options: RecordOptions, session: ToolSession, recorder: Recorder, output: Output) -> None:
    """Show how it goes until the time is over, or until told to stop."""
    begun_s = shown_s = time.monotonic()
    live = sys.stdout.isatty() and not output.as_json
    with output.display() as display:
        while session.wait(POLL_S):
            now_s = time.monotonic()
            if options.for_ is not None and now_s - begun_s >= options.for_:
                return
            if options.last is not None and _entered():
                recorder.trigger("command")
            if live and now_s - shown_s >= PERIOD_S:
                shown_s = now_s
                progress = recorder.progress()
                rows = [_row(now_s - begun_s, progress)]
                display.show(view_of(COLUMNS, rows, [], []))


COLUMNS = ("s", "messages", "MB", "missed", "file", "")


def _row(seconds: float, progress: Progress) -> list[object]:
    name = progress.writing.name if progress.writing else "waits for a trigger"
    size_mb = round(progress.size / 1e6, 1)
    fault = progress.failure or progress.delay
    return [round(seconds), progress.taken, size_mb, progress.missed, name, fault]


def _entered() -> bool:
    """Return whether Enter was pressed on a terminal."""
    with suppress(OSError, ValueError):
        if sys.stdin.isatty() and select.select([sys.stdin], [], [], 0)[0]:
            return bool(sys.stdin.readline())
    return False


def _silence(
    options: RecordOptions, session: ToolSession, files: Sequence[Path], output: Output
) -> str:
    """Return why files have nothing of what was asked for; empty if they have some of it."""
    keys_found: set[str] = set()
    for path in files:
        with Recording(path) as recording:
            keys_found |= {each.topic.removeprefix("/") for each in recording.channels()}
    wanted = options.keys or default_keys(session.namespace)
    silent = [each for each in wanted if not any(map(matcher((each,)), keys_found))]
    if not silent or (not options.keys and len(silent) < len(wanted)):
        return ""
    if not session.connected:
        return "nothing arrived: the router is gone"
    if not options.keys:
        return "nothing of a camera arrived: is one running? `zv up` starts a system"
    known = discover(session)
    words = "; ".join(known.nothing_on(key_expression(each)) for each in silent)
    if len(silent) == len(wanted):
        return words
    output.note(words)
    return ""


def _tell(path: Path, output: Output) -> None:
    with Recording(path) as recording:
        report = report_of(recording)
    output.result(report.to_map(), file_line(report))


def trigger(options: TriggerOptions, connection: Connection, output: Output) -> None:
    """Trigger the recorders that keep their last seconds.

    Raises:
        ExpectationNotMet: None answers.
    """
    with ToolSession(connection) as session:
        key = keys.record_key(session.namespace, options.recorder)
        replies = session.ask(key, bytes(msgpack.packb({"reason": options.reason})))
    found = 0
    for reply in replies:
        try:
            fields = unpack(reply.ok.payload.to_bytes()) if reply.ok else None
        except PayloadError:
            continue
        if isinstance(fields, dict):
            found += 1
            name, folder = fields.get("recorder"), fields.get("folder")
            output.result(fields, f"{name} writes into {folder}")
    if not found:
        raise ExpectationNotMet(
            f"no recorder answers on {key}: one with --last does, such as zv bag record --last 30s"
        )
