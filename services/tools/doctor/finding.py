"""One line of a diagnosis, and all of them together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from services.tools.output import Output, printable

Level = Literal["OK", "WARN", "FAIL"]
STYLES: dict[Level, str] = {"OK": "green", "WARN": "yellow", "FAIL": "bold red"}


@dataclass(frozen=True, slots=True)
class Finding:
    """What was found.

    Attributes:
        level: ``OK``; ``WARN``: it works, but not as it should; ``FAIL``: something does not.
        check: Which check it is of; docs/doctor.md has a section for each.
        text: What is so.
        remedy: What to do; empty if nothing.
        nodes: Names of the nodes that it is about.
    """

    level: Level
    check: str
    text: str
    remedy: str = ""
    nodes: tuple[str, ...] = ()


class Diagnosis:
    """Prints findings as they come, and remembers them.

    Args:
        output: Where to.
    """

    def __init__(self, output: Output) -> None:
        self.findings: list[Finding] = []
        self._output = output

    def add(self, findings: Iterable[Finding]) -> None:
        """Print findings."""
        for finding in findings:
            self.findings.append(finding)
            self._print(finding)

    def failed(self) -> list[Finding]:
        """Return what failed."""
        return [finding for finding in self.findings if finding.level == "FAIL"]

    def _print(self, finding: Finding) -> None:
        if self._output.as_json:
            self._output.record(
                {
                    "level": finding.level,
                    "check": finding.check,
                    "text": finding.text,
                    "remedy": finding.remedy,
                    "nodes": list(finding.nodes),
                }
            )
            return
        from rich.text import Text

        remedy = f" -> {finding.remedy}" if finding.remedy else ""
        self._output.show(
            Text.assemble(
                (f"{finding.level:<5}", STYLES[finding.level]),
                (f"{finding.check:<11}", "bold"),
                printable(finding.text),
                (printable(remedy), "cyan"),
            )
        )
