"""Prints errors and log entries to standard error, one line each, and sets the exit status.

Tracebacks are shown with ``--debug`` only. If the reader of the output stops reading, as in
``zv ... | head``, that is not an error.
"""

from __future__ import annotations

import logging
import os
import select
import signal
import sys
import threading
import traceback
from copy import copy

import click

from zenoh_vision.error_text import printable
from zenoh_vision.errors import VisionError
from zenoh_vision.host.signals import SIGNALS

FAULT_STATUS = 70
"""The exit status of an unexpected error: EX_SOFTWARE of sysexits.h."""

USAGE_STATUS = 2


def reader_is_gone(error: BaseException) -> bool:
    """Tell whether an error only means that nobody reads our output any more.

    If so, further output is discarded, so that the last flush does not fail again.
    """
    if isinstance(error, SystemExit):  # raised by rich, which redirected the output itself
        return isinstance(error.__context__, BrokenPipeError)
    output = select.poll()
    output.register(1, 0)
    closed = any(event & select.POLLERR for _, event in output.poll(0))
    if not isinstance(error, BrokenPipeError) or not closed:
        return False
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    return True


def tell(error: Exception, *, debug: bool) -> int:
    """Print an error in one line, with ``debug`` its traceback too; return its exit status."""
    if isinstance(error, click.UsageError):
        _say(_wrong_use(error))
        return USAGE_STATUS
    if debug:
        print(_lines("".join(traceback.format_exception(error))), file=sys.stderr)
    if isinstance(error, VisionError):
        if error.exit_status:
            _say(str(error))
        return error.exit_status
    _say(fault(error))
    return FAULT_STATUS


def fault(error: BaseException) -> str:
    """Return the line for an error that is a bug in ``zv``."""
    return (
        f"unexpected {type(error).__name__}: {_one_line(str(error))}; "
        "this is a bug in zv, --debug shows the traceback"
    )


def tell_end_of_thread(ended: threading.ExceptHookArgs) -> None:
    """Print, in one line, an error that ended a thread; a ``threading.excepthook``."""
    error = ended.exc_value
    if error is not None:
        _say(f"in thread {ended.thread.name if ended.thread else '?'}: {fault(error)}")


def _wrong_use(error: click.UsageError) -> str:
    """Return Click's message in our form; reword those that differ between Click's versions."""
    if isinstance(error, click.NoSuchOption):
        near = ", ".join(sorted(error.possibilities or ()))
        message = f"no such option: {error.option_name}"
        message += near and f" (Possible options: {near})"
    elif isinstance(error, click.exceptions.NoSuchCommand):
        near = ", ".join(map(repr, error.possibilities or ()))
        message = f"no such command {error.command_name!r}"
        message += near and f". Did you mean {near}?"
    else:
        message = _one_line(error.format_message()).rstrip(".")
        message = message[:1].lower() + message[1:]
    return message if error.ctx is None else f"{message}; see {error.ctx.command_path} --help"


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _lines(text: str) -> str:
    """Return lines, such as a traceback, each printable."""
    return "\n".join(map(printable, text.rstrip("\n").split("\n")))


def _say(text: str) -> None:
    print(f"zv: {printable(text)}", file=sys.stderr)


class LogLine(logging.Formatter):
    """Formats a log entry as one line; an exception without its traceback, unless for debugging."""

    def __init__(self, *, debug: bool) -> None:
        super().__init__("%(asctime)s %(levelname)-7s %(name)s: %(message)s", "%H:%M:%S")
        self._debug = debug

    def format(self, record: logging.LogRecord) -> str:
        """Return the entry as text."""
        plain = copy(record)
        plain.msg, plain.args = printable(record.getMessage()), None
        error = record.exc_info[1] if record.exc_info else None
        if self._debug or error is None:
            return _lines(super().format(plain))
        plain.exc_info = plain.exc_text = None
        words = printable(_one_line(f"{type(error).__name__}: {error}"))
        return f"{super().format(plain)}: {words} (--debug shows the traceback)"


def log_to_stderr(debug: bool, level: int = logging.INFO) -> None:
    """Send the log to standard error, one line per entry."""
    handler = logging.StreamHandler()
    handler.setFormatter(LogLine(debug=debug))
    logging.basicConfig(level=logging.DEBUG if debug else level, handlers=[handler])


def leave_on_signals() -> None:
    """Exit at once on a signal until a node handles signals: nothing needs to be closed yet.

    An exception would be raised in arbitrary code, which may swallow or wrap it.
    """
    for number in SIGNALS:
        signal.signal(number, lambda _number, _at: os._exit(0))
