"""Logs who changed which parameter through the viewer, from what to what."""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass

from zenoh_vision.error_text import shortened
from zenoh_vision.messages import Parameter

log = logging.getLogger("viewer")

PERIOD_S = 1.0
MAX_LINES = 100
"""Limit of lines in a period; of more changes, only the number is logged."""

NAME = re.compile(r"\w{1,100}")


@dataclass(slots=True)
class LoggedChange:
    """The changes of one parameter by one client within a period."""

    before: str
    after: str
    outcome: str
    steps: int


class ParameterAudit:
    """Logs each attempt to change a parameter, within a second; on the event loop.

    The many steps of a slider are one line, so that its last value is never left out.
    """

    def __init__(self) -> None:
        self._changes: dict[tuple[str, str, str, bool], LoggedChange] = {}
        self._left_out = 0

    def note(
        self,
        who: str,
        node: str,
        known: Mapping[str, Parameter],
        values: Mapping[str, object],
        outcome: str,
        *,
        accepted: bool,
    ) -> None:
        """Log soon that someone set parameters of a node; ``known`` are those before."""
        if not self._changes:
            asyncio.get_running_loop().call_later(PERIOD_S, self.flush)
        for name, value in values.items():
            shown = name if NAME.fullmatch(name) else shortened(name)
            key = who, node, shown, accepted
            before = shortened(known[name].value) if name in known else "unknown"
            change = self._changes.get(key)
            if change is not None:
                change.after, change.outcome = shortened(value), outcome
                change.steps += 1
            elif len(self._changes) < MAX_LINES:
                self._changes[key] = LoggedChange(before, shortened(value), outcome, 1)
            else:
                self._left_out += 1

    def flush(self) -> None:
        """Log the changes that have been noted."""
        for (who, node, name, _), change in self._changes.items():
            steps = f" in {change.steps} steps" if change.steps > 1 else ""
            log.info(
                "%s set %s of %s from %s to %s%s: %s",
                *(who, name, node, change.before, change.after, steps, change.outcome),
            )
        if self._left_out:
            log.info("%d more changes of parameters were not logged", self._left_out)
        self._changes.clear()
        self._left_out = 0
