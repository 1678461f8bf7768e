"""Prints errors and log entries to standard error, one line each, and sets the exit status.

Only bugs have tracebacks, and only with ``--debug``. If the reader of the output stops reading, as
in ``zv ... | head``, that is not an error.
"""

from __future__ import annotations

import errno
import gc
import io
import logging
import os
import select
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from copy import copy
from functools import partial
from pathlib import Path
from typing import NoReturn

import click

from zenoh_vision.error_text import did_you_mean, printable, similar_names
from zenoh_vision.errors import ConnectionFault, RouterUnreachable, SourceError, VisionError
from zenoh_vision.host import abandoned_threads
from zenoh_vision.host.lifeline import is_launched
from zenoh_vision.host.signals import SIGNALS

FAULT_STATUS = 70
"""The exit status of an unexpected error: EX_SOFTWARE of sysexits.h."""

USAGE_STATUS = 2
INACCESSIBLE = (errno.EACCES, errno.ENAMETOOLONG)
"""Errors that even ``Path.exists`` raises, which the programs call in many places."""

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of whatever is written, standard output too, when a disk is full."""


def reader_is_gone(error: BaseException) -> bool:
    """Tell whether an error only means that the reader of our output is gone.

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


def exit_with_status(
    run: Callable[[], int | None], program: str = "zv", file: str | None = None
) -> NoReturn:
    """Run a program to its end and exit; an error is printed in one line and becomes the status.

    Args:
        run: The program; returns its exit status, None for 0.
        program: Its name, with which each error begins.
        file: Its source file; an unexpected error is printed with the line in it.
    """
    debug = "--debug" in sys.argv[1:]
    _open_closed_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # what the locale's encoding lacks
    if not debug:
        threading.excepthook = partial(tell_end_of_thread, program=program, file=file)
    try:
        status = run() or 0
        sys.stdout.flush()
    except KeyboardInterrupt:
        status = 0
    except (Exception, SystemExit) as error:
        if reader_is_gone(error):
            status = 0
        elif isinstance(error, SystemExit):
            raise
        else:
            status = tell(error, debug=debug, program=program, file=file)
            _discard_unwritable()
    if abandoned_threads.any_is_alive():
        logging.shutdown()
        with suppress(OSError):
            sys.stdout.flush()
        os._exit(status)
    # The interpreter would look through all objects once more, a tenth of a second. So nothing may
    # depend on being finalised at the end: files are closed before.
    gc.freeze()
    sys.exit(status)


def _open_closed_streams() -> None:
    """Open the standard streams that are closed on the null device.

    Else the next file or socket has the number of one, and receives what a library prints.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # the lowest number that is free is its own
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), mode))


def _discard_unwritable() -> None:
    """Discard output that cannot be written: else the last flush fails, and the status is 120."""
    for stream, descriptor in ((sys.stdout, 1), (sys.stderr, 2)):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), descriptor)


def tell(error: Exception, *, debug: bool, program: str = "zv", file: str | None = None) -> int:
    """Print an error in one line; return its exit status.

    With ``debug``, the traceback of a bug is printed too; errors of the user have none.
    """
    if isinstance(error, click.UsageError):
        _say(_wrong_use(error), program)
        return USAGE_STATUS
    if isinstance(error, VisionError):
        if error.exit_status:
            _say(str(error), program)
        if isinstance(error, ConnectionFault) and is_launched():
            return RouterUnreachable.exit_status  # zv up is to try again: names and clocks change
        return error.exit_status
    if isinstance(error, OSError) and (
        error.errno in FULL or (error.errno in INACCESSIBLE and error.filename is not None)
    ):
        _say(f"{error.filename or 'cannot write'}: {error.strerror}", program)
        return SourceError.exit_status
    if isinstance(error, FileNotFoundError) and _is_folder_gone():
        _say("the current folder was deleted; change to another one", program)
        return SourceError.exit_status
    if debug:
        print(_lines("".join(traceback.format_exception(error))), file=sys.stderr)
    _say(fault(error, program, file), program)
    return FAULT_STATUS


def _is_folder_gone() -> bool:
    """Tell whether relative paths mean nothing, since the current folder was deleted."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def fault(error: BaseException, program: str = "zv", file: str | None = None) -> str:
    """Return the line for an error that is a bug in a program, with the line in its file if any."""
    at = [
        each.lineno for each in traceback.extract_tb(error.__traceback__) if each.filename == file
    ]
    place = f" ({Path(file).name}, line {at[-1]})" if file and at else ""
    return (
        f"unexpected {type(error).__name__}: {_one_line(str(error))}; "
        f"this is a bug in {program}{place}, --debug shows the traceback"
    )


def tell_end_of_thread(
    ended: threading.ExceptHookArgs, program: str = "zv", file: str | None = None
) -> None:
    """Print, in one line, an error that ended a thread; a ``threading.excepthook``."""
    error = ended.exc_value
    if error is not None:
        name = ended.thread.name if ended.thread else "?"
        _say(f"in thread {name}: {fault(error, program, file)}", program)


def _wrong_use(error: click.UsageError) -> str:
    """Return Click's message in our form; reword those that differ between Click's versions."""
    if isinstance(error, click.NoSuchOption):
        message = f"no such option: {error.option_name}"
        found = error.possibilities or ()  # the dashes, which all share, make many similar
        near = similar_names(error.option_name, found, limit=2, similarity=0.75)
        message += did_you_mean(near, before="; ")
    elif isinstance(error, click.exceptions.NoSuchCommand):
        message = f"no such command {error.command_name!r}"
        message += did_you_mean(error.possibilities or (), before="; ")
    else:
        message = _one_line(error.format_message()).rstrip(".")
        message = message[:1].lower() + message[1:]
    if error.ctx is None:
        return message
    separator = "" if message.endswith("?") else ";"
    return f"{message}{separator} see {error.ctx.command_path} --help"


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _lines(text: str) -> str:
    """Return lines, such as a traceback, each printable."""
    return "\n".join(map(printable, text.rstrip("\n").split("\n")))


def _say(text: str, program: str) -> None:
    with suppress(OSError):  # the status says it too, where the text cannot be written
        print(f"{program}: {printable(text)}", file=sys.stderr)


class LogLine(logging.Formatter):
    """Formats a log entry as one line; a bug with its traceback, if that is wanted."""

    def __init__(self, *, debug: bool) -> None:
        super().__init__("%(asctime)s %(levelname)-7s %(name)s: %(message)s", "%H:%M:%S")
        self._debug = debug

    def format(self, record: logging.LogRecord) -> str:
        """Return the entry as text."""
        plain = copy(record)
        plain.msg, plain.args = printable(record.getMessage()), None
        error = record.exc_info[1] if record.exc_info else None
        expected = isinstance(error, VisionError)
        if error is None or (self._debug and not expected):
            return _lines(super().format(plain))
        plain.exc_info = plain.exc_text = None
        if expected:
            return f"{super().format(plain)}: {printable(_one_line(str(error)))}"
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
