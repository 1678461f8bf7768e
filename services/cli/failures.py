"""How ``zv`` ends when something is wrong: one line on standard error, and an exit status.

A traceback is for who asks for it with ``--debug``. That the reader of ``zv ... | head`` has had
enough is nothing wrong.
"""

from __future__ import annotations

import os
import select
import sys
import threading
import traceback
from collections.abc import Callable

import typer

from common.errors import VisionError

FAULT_STATUS = 70
"""What none of our errors stands for: a fault in ``zv`` itself. EX_SOFTWARE of sysexits.h."""

USAGE_STATUS = 2
UsageError = typer.BadParameter.__mro__[1]
"""Every wrong use that typer finds. It shows only some of its kinds under names of their own."""


def watch_reader() -> Callable[[BaseException], bool]:
    """Return what tells of an error whether it only says that the reader of our output is gone.

    If so, whatever is still to be written goes nowhere, and does not fail once more at the end.
    typer and rich end the program with status 1 then; of them their ``SystemExit`` is judged.
    """
    try:
        output = os.dup(1)  # rich puts something else in the place of the first
    except OSError:  # it was closed from the start
        return lambda _: False
    poll = select.poll()
    poll.register(output, 0)

    def gone(error: BaseException) -> bool:
        cause = error.__context__ if isinstance(error, SystemExit) else error
        if not isinstance(cause, BrokenPipeError) or not poll.poll(0):
            return False
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return True

    return gone


def tell(error: Exception, *, debug: bool) -> int:
    """Say what is wrong in one line.

    Args:
        error: What ended the command.
        debug: Show the traceback too.

    Returns:
        The exit status.
    """
    if type(error).__name__ == "NoArgsIsHelpError":  # who types no command asks what there is
        return 0
    if isinstance(error, UsageError):
        _say(_wrong_use(error))
        return USAGE_STATUS
    if debug:
        traceback.print_exception(error)
    if isinstance(error, VisionError):
        if error.exit_status:
            _say(str(error))
        return error.exit_status
    _say(fault(error))
    return FAULT_STATUS


def fault(error: BaseException) -> str:
    """Return the line for an error that nobody foresaw."""
    return (
        f"unexpected {type(error).__name__}: {_one_line(str(error))}; "
        "this is a fault in zv, --debug shows where"
    )


def watch_threads(*, debug: bool) -> None:
    """Let an error that ends a thread be one line too, unless all is to be shown."""
    if not debug:
        threading.excepthook = _end_of_thread


def _end_of_thread(ended: threading.ExceptHookArgs) -> None:
    error = ended.exc_value
    if error is not None:
        _say(f"in thread {ended.thread.name if ended.thread else '?'}: {fault(error)}")


def _wrong_use(error: Exception) -> str:
    message = _one_line(error.format_message()).rstrip(".")  # type: ignore[attr-defined]
    message = message[:1].lower() + message[1:].replace("Value error, ", "")
    context = error.ctx  # type: ignore[attr-defined]
    return message if context is None else f"{message}; see {context.command_path} --help"


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _say(text: str) -> None:
    print(f"zv: {text}", file=sys.stderr)
