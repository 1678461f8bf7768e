"""Processes that only this program uses, to run services without those of a system."""

from __future__ import annotations

import logging
import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from tempfile import TemporaryFile
from typing import IO, Final, Self

from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, SourceError

STOP_S: Final = 5.0
KEPT_BYTES: Final = 4000
"""Bytes of a log that an error shows."""

WARNING: Final = re.compile(r"^\S+ WARNING +(?!lockstep:)(\S+): (.+)$", re.MULTILINE)
"""A warning in a log, but of whom a replay waits for."""


def zv_command(*words: str) -> list[str]:
    """Return a command of this program, for this interpreter."""
    # -P: do not import from a folder named zv in the working directory.
    return [sys.executable, "-P", "-m", "zv", *words]


@dataclass
class Child:
    """A process at a router, which ends with this program, whatever ends that.

    ``ZV_CONNECT`` and ``ZV_NAMESPACE`` are set for it.
    """

    command: Sequence[str]
    endpoint: str
    namespace: str

    def __enter__(self) -> Self:
        """Start it, in a session of its own, so that Ctrl-C reaches it through us alone.

        Raises:
            ExpectationNotMet: There is no such program.
        """
        kept = {name: text for name, text in os.environ.items() if not name.startswith("ZV_")}
        lifeline, self._ours = os.pipe()
        given = {"ZV_CONNECT": self.endpoint, "ZV_NAMESPACE": self.namespace}
        self._log: IO[bytes] = TemporaryFile()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - what the user asked for
                self.command,
                env={**kept, **given, "ZV_LIFELINE": str(lifeline)},
                stdin=subprocess.DEVNULL,
                stdout=self._log,
                stderr=self._log,
                pass_fds=[lifeline],
                start_new_session=True,
            )
        except OSError as error:
            os.close(self._ours)
            self._log.close()
            raise ExpectationNotMet(f"{self.command[0]}: {error.strerror}") from None
        finally:
            os.close(lifeline)
        return self

    def __exit__(self, *error: object) -> None:
        """End it as Ctrl-C does, by force if it must be."""
        if self.status is None:
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait(STOP_S)
        os.close(self._ours)
        self._log.close()

    @property
    def status(self) -> int | None:
        """Its exit status; None while it runs."""
        return self._process.poll()

    def said(self) -> str:
        """Return the end of what it has printed and logged."""
        self._log.seek(0, os.SEEK_END)
        self._log.seek(max(0, self._log.tell() - KEPT_BYTES))
        return self._log.read().decode(errors="replace").strip()

    def pass_on_warnings(self) -> None:
        """Log the last warnings that a command of this program has logged."""
        for name, words in WARNING.findall(self.said()):
            logging.getLogger(name).warning("%s", words)

    def check(self, expected: int | None = None) -> None:
        """Raise what a command of this program has said if it has ended.

        With the exit status ``expected`` nothing is raised.

        Raises:
            ConfigurationError, SourceError, ExpectationNotMet: By its exit status.
        """
        status = self.status
        if status is None or status == expected:
            return
        lines = self.said().splitlines()
        words = lines[-1] if lines else f"{self.command[4]} ended with status {status}"
        kinds = {each.exit_status: each for each in (ConfigurationError, SourceError)}
        raise kinds.get(status, ExpectationNotMet)(words.partition("zv: ")[2] or words)
