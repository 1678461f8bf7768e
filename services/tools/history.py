"""What nodes reported over the last seconds, each run of each node apart."""

from __future__ import annotations

from collections.abc import Iterable

from common.messages import Diagnostics
from services.figures.change import Change, change_between
from services.tools.nodes import Presence


class History:
    """The reports of all nodes that are asked again and again.

    Args:
        horizon_s: Reports older than so long before a node's newest are let go.
    """

    def __init__(self, horizon_s: float) -> None:
        self._horizon_s = horizon_s
        self._reports: dict[tuple[str, str | None], list[Diagnostics]] = {}

    def note(self, presences: Iterable[Presence]) -> None:
        """Take what was found now; what is there no more is forgotten."""
        reports = {}
        for each in presences:
            if each.report is not None:
                known = self._reports.get((each.name, each.session), [])
                reports[each.name, each.session] = self._extended(known, each.report)
        self._reports = reports

    def change(self, presence: Presence) -> Change | None:
        """Return what a node's counters did over the time that is kept; None before two reports."""
        reports = self._reports.get((presence.name, presence.session), [])
        if len(reports) < 2:
            return None
        first, last = reports[0], reports[-1]
        return change_between(first.counters, last.counters, last.uptime_s - first.uptime_s)

    def _extended(self, known: list[Diagnostics], report: Diagnostics) -> list[Diagnostics]:
        if known and report.uptime_s <= known[-1].uptime_s:
            return known  # answered before; it reports once a second
        return [*(r for r in known if report.uptime_s - r.uptime_s <= self._horizon_s), report]
