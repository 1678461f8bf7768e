"""``zv topic echo``: messages as they come, readable, as JSON or as comma-separated values."""

from __future__ import annotations

import time
from collections import deque

import zenoh

from common.connection import Connection
from common.errors import ConfigurationError, ExpectationNotMet
from services.tools.output import Output
from services.tools.session import ToolSession, key_expression
from services.tools.survey import survey
from services.tools.topic.contents import Received, received
from services.tools.topic.options import EchoOptions
from services.tools.topic.printer import Printer

MOST_WAITING = 1000
ASK_AFTER_S = 1.0
"""After so long without a message, the newest there is comes by query: latched ones do not flow."""


def run(options: EchoOptions, connection: Connection, output: Output) -> None:
    """Print messages until told to stop, or as many or as long as asked for.

    Raises:
        ConfigurationError: No such field.
        ExpectationNotMet: Fewer came than asked for in the time given, or none.
    """
    if options.csv and output.as_json:
        raise ConfigurationError("--csv and --json are two forms: give one")
    pattern = key_expression(options.key)
    with ToolSession(connection) as session:
        _Listener(pattern, options, session, output).listen()


class _Listener:
    def __init__(
        self, pattern: str, options: EchoOptions, session: ToolSession, output: Output
    ) -> None:
        self._pattern = pattern
        self._session = session
        self._output = output
        self._printer = Printer(options, output)
        self._wanted = 1 if options.once else options.count
        self._for_s = options.for_
        self._waiting: deque[Received] = deque(maxlen=MOST_WAITING)
        self._arrived = 0
        self._printed = 0
        self._overrun = False
        self._explained = False

    @property
    def _done(self) -> bool:
        return self._wanted is not None and self._printed >= self._wanted

    def listen(self) -> None:
        session = self._session
        session.subscribe(self._pattern, self._take)
        end_s = time.monotonic() + (self._for_s or float("inf"))
        asked = False
        ask_s = time.monotonic() + ASK_AFTER_S
        while not session.stopping and not self._done and time.monotonic() < end_s:
            self._print_waiting()
            if not asked and not self._printed and time.monotonic() > ask_s:
                asked = True
                self._ask()
            if not self._waiting and not self._done:
                session.wait(min(1.0, end_s - time.monotonic()), until=lambda: self._waiting)
        if session.stopping or self._done or self._for_s is None:
            return
        if self._printed == 0:
            raise ExpectationNotMet(
                f"nothing came on {self._pattern} in {self._for_s:g} s"
                if self._explained
                else survey(session).nothing_on(self._pattern)
            )
        if self._wanted is not None:
            raise ExpectationNotMet(
                f"{self._printed} of {self._wanted} messages came on {self._pattern} "
                f"in {self._for_s:g} s"
            )

    def _take(self, sample: zenoh.Sample) -> None:
        if len(self._waiting) == MOST_WAITING:
            self._overrun = True
        self._waiting.append(received(sample))
        self._arrived += 1

    def _print_waiting(self) -> None:
        while self._waiting and not self._done and not self._session.stopping:
            self._printed += self._printer.show(self._waiting.popleft())
        if self._overrun:
            self._overrun = False
            self._output.note("messages come faster than they can be printed: some were left out")

    def _ask(self) -> None:
        """Show the newest there is; where there is nothing at all, say what there is."""
        replies = [reply.ok for reply in self._session.ask(self._pattern) if reply.ok]
        if self._arrived:
            return
        for sample in replies:
            if not self._done:
                self._printed += self._printer.show(received(sample))
        if not replies:
            self._explained = True
            self._output.note(f"{survey(self._session).nothing_on(self._pattern)}; waiting")
