"""Progress of work on files, on a terminal, and its end on Ctrl-C."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.host.signals import StopSignals
from zv.tools.shared.output import Output


@contextmanager
def progress_on(output: Output) -> Iterator[Callable[[int, int], None]]:
    """Yield what shows progress when it is called with what is done, and all that is to do.

    After SIGINT or SIGTERM a call raises ``ExpectationNotMet``, so that what is not complete can be
    deleted.
    """
    with StopSignals() as signals:

        def check(_done: int, _total: int) -> None:
            if signals.stopping:
                raise ExpectationNotMet("stopped before it was complete; nothing was written")

        if output.as_json or not sys.stderr.isatty():
            yield check
            return
        from rich.console import Console
        from rich.progress import Progress

        with Progress(console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task("", total=None)

            def show(done: int, total: int) -> None:
                check(done, total)
                bar.update(task, completed=done, total=max(total, 1))

            yield show
