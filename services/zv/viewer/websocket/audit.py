"""Logs the changes of parameters through the viewer: client, parameter, old and new value."""

from __future__ import annotations

import asyncio
import logging
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from zenoh_vision.error_text import shortened
from zenoh_vision.messages import Parameter

log = logging.getLogger("viewer")

PERIOD_S = 1.0
MAX_LINES = 100
"""Limit of lines in a period; of more changes, only the number is logged. Refused changes have a
limit of this size for themselves, so that they never displace one that took effect."""

MAX_REFUSED = 10
"""Limit of a client's refused changes in a period, so that it displaces few of other clients."""

NAME = re.compile(r"\w{1,100}")


@dataclass(slots=True)
class LoggedChange:
    """The changes of one parameter by one client within a period."""

    before: str
    after: str
    outcome: str
    steps: int = 0


class ParameterAudit:
    """Logs each attempt to change a parameter, within a second; on the event loop.

    The steps of a slider are logged as one line, so that its last value is never left out.
    """

    def __init__(self) -> None:
        self._changes: dict[tuple[str, str, str, bool], LoggedChange] = {}
        self._refused: Counter[str] = Counter()  # lines about refused changes, by client
        self._left_out: Counter[bool] = Counter()  # by whether they were refused

    def note(
        self,
        who: str,
        node: str,
        known: Mapping[str, Parameter],
        values: Mapping[str, object],
        outcome: str,
        *,
        refused: bool,
    ) -> None:
        """Record that a client set parameters of a node; ``known`` are the values before."""
        for name, value in values.items():
            shown = name if NAME.fullmatch(name) else shortened(name)
            before = shortened(known[name].value) if name in known else "unknown"
            change = LoggedChange(f" from {before}", f" to {shortened(value)}", outcome)
            self._add((who, node, shown, refused), change)

    def note_forbidden(self, who: str, node: str, outcome: str) -> None:
        """Record that a client without permission tried to set parameters of a node."""
        self._add((who, node, "parameters", True), LoggedChange("", "", outcome))

    def _add(self, key: tuple[str, str, str, bool], new: LoggedChange) -> None:
        if not self._changes:
            asyncio.get_running_loop().call_later(PERIOD_S, self.flush)
        who, _, _, refused = key
        if key not in self._changes:
            of_all = self._refused.total()
            lines = of_all if refused else len(self._changes) - of_all
            if lines >= MAX_LINES or (refused and self._refused[who] >= MAX_REFUSED):
                self._left_out[refused] += 1
                return
            self._refused[who] += refused
        change = self._changes.setdefault(key, new)
        change.after, change.outcome = new.after, new.outcome
        change.steps += 1

    def flush(self) -> None:
        """Log the changes that have been noted."""
        for (who, node, name, _), change in self._changes.items():
            steps = f" in {change.steps} steps" if change.steps > 1 else ""
            log.info(
                "%s set %s of %s%s%s%s: %s",
                *(who, name, node, change.before, change.after, steps, change.outcome),
            )
        for refused, number in self._left_out.items():
            kind = "refused changes" if refused else "changes"
            log.info("%d more %s of parameters were not logged", number, kind)
        self._changes.clear()
        self._refused.clear()
        self._left_out.clear()
