"""``zv bag info``: shows what is in a recording, and what is missing."""

from __future__ import annotations

import time
from typing import Any

from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.keys import type_of
from zenoh_vision.transport.connection import Connection
from zv.bag.recording import Recording
from zv.bag.report import Report, report_of
from zv.tools.bag.options import InfoOptions
from zv.tools.shared.output import Output

MAX_TIME_NS = 253_402_300_799 * 10**9
"""The last time that has four digits in its year."""


def run(options: InfoOptions, _: Connection, output: Output) -> None:
    """Show what is in a recording.

    Raises:
        RecordingError: It cannot be opened, or is none.
        ExpectationNotMet: It is damaged, or was not closed; what is readable is shown before.
    """
    with Recording(options.file) as recording:
        report = report_of(recording)
    if output.as_json:
        minutes = {"minutes": report.minutes} if options.minutes else {}
        output.record({**report.to_map(), **minutes})
    else:
        _show(report, output, minutes=options.minutes)
    if report.problems:
        raise ExpectationNotMet(f"{options.file}: {'; '.join(report.problems[:5])}")
    if not report.is_closed:
        raise ExpectationNotMet(f"{options.file}: {report.ended}")


def file_line(report: Report) -> str:
    """Return a recording in one line."""
    seconds = (report.end_ns - report.start_ns) / 1e9
    return (
        f"{report.path}: {report.messages} messages, {report.size / 1e6:.1f} MB, {seconds:.1f} s, "
        f"{report.verdict}"
    )


def _show(report: Report, output: Output, *, minutes: bool) -> None:
    seconds = (report.end_ns - report.start_ns) / 1e9
    output.line(file_line(report))
    output.line(f"from {time_text(report.start_ns)} to {time_text(report.end_ns)}; {report.ended}")
    for note in report.notes:
        output.line(f"note: {note}")
    rows = []
    for each in report.keys:
        rate = round(each.count / seconds, 2) if seconds > 0 else None
        size_mb = round(each.bytes / 1e6, 3)
        kind = type_of(each.encoding)
        rows.append([each.key, kind, each.count, size_mb, rate, each.verdict])
    if rows:
        output.table(("key", "type", "messages", "MB", "Hz", "completeness"), rows)
    if minutes:
        output.table(("from", "s", "key", "messages", "missed"), _minute_rows(report))


def _minute_rows(report: Report) -> list[list[Any]]:
    rows: list[list[Any]] = []
    for account in report.minutes:
        begin_ns, end_ns = account["begin_ns"], account["end_ns"]
        for key, fields in sorted(account["keys"].items()):
            words = ", ".join(f"{count} {reason}" for reason, count in fields["missed"].items())
            seconds = round((end_ns - begin_ns) / 1e9, 1)
            rows.append([time_text(begin_ns), seconds, key, fields["taken"], words or "0"])
    return rows


def time_text(ns: int) -> str:
    """Return a time in UTC, or the number where it is no year of four digits."""
    if not 0 <= ns < MAX_TIME_NS:
        return f"{ns} ns"
    text = time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(ns // 10**9))
    return f"{text}.{ns % 10**9 // 10**6:03d}Z"
