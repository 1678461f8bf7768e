"""The log: one line an entry, whatever is in it."""

from __future__ import annotations

import logging
import re

from zenoh_vision.cli.errors import LogLine


def logged(*, debug: bool) -> str:
    """Return an entry about an exception, as it is written."""
    try:
        raise ValueError("two\nlines")
    except ValueError as error:
        found = (ValueError, error, error.__traceback__)
    record = logging.LogRecord("tracker", logging.ERROR, "f", 1, "no %s", ("answer",), found)
    return LogLine(debug=debug).format(record)


def test_an_exception_in_the_log_is_one_line():
    form = (
        r"\d\d:\d\d:\d\d ERROR   tracker: no answer: ValueError: two lines "
        r"\(--debug shows the traceback\)"
    )
    assert re.fullmatch(form, logged(debug=False))


def test_with_debug_it_has_its_traceback():
    lines = logged(debug=True).splitlines()
    assert lines[0].endswith("ERROR   tracker: no answer")
    assert lines[1] == "Traceback (most recent call last):"


def test_an_entry_keeps_its_exception_for_other_handlers():
    record = logging.LogRecord("x", logging.ERROR, "f", 1, "m", (), (OSError, OSError("o"), None))
    LogLine(debug=False).format(record)
    assert record.exc_info is not None


def test_foreign_text_in_an_entry_is_printable():
    for debug in (False, True):
        try:
            raise ValueError("\x1b[2J\u202e")
        except ValueError as error:
            found = (ValueError, error, error.__traceback__)
        record = logging.LogRecord("x", logging.ERROR, "f", 1, "no %s", ("\x1b]0;t\x07\nb",), found)
        text = LogLine(debug=debug).format(record)
        assert all(line.isprintable() for line in text.split("\n"))
        assert "no \\x1b]0;t\\x07\\nb" in text
