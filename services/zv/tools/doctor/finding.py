"""The findings of ``zv doctor``, and how they are printed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Literal

from zenoh_vision.error_text import printable
from zv.tools.shared.output import Output

Verdict = Literal["OK", "WARN", "FAIL"]
STYLES: dict[Verdict, str] = {"OK": "green", "WARN": "yellow", "FAIL": "bold red"}


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of one check.

    Attributes:
        level: ``OK``; ``WARN``: it works, but not as it should; ``FAIL``: something does not.
        check: Name of the check; docs/doctor.md has a section for each.
        remedy: What to do about it; may be empty.
        nodes: Names of the nodes that it is about.
    """

    level: Verdict
    check: str
    text: str
    remedy: str = ""
    nodes: tuple[str, ...] = ()


def or_ok(problems: Iterable[Finding], check: str, text: str) -> list[Finding]:
    """Return the problems that a check found, or the finding that there are none."""
    return list(problems) or [Finding("OK", check, text)]


class Diagnosis:
    """Prints findings as they are added, and counts them."""

    def __init__(self, output: Output) -> None:
        self._output = output
        self._count: Counter[Verdict] = Counter()

    @property
    def failed(self) -> bool:
        """Whether a finding is a failure."""
        return self._count["FAIL"] > 0

    @property
    def summary(self) -> str:
        """How many findings there are of each level."""
        return ", ".join(f"{self._count[level]} {level}" for level in STYLES)

    def add(self, findings: Iterable[Finding]) -> None:
        """Print findings."""
        for finding in findings:
            self._count[finding.level] += 1
            if self._output.as_json:
                self._output.record(asdict(finding))
            else:
                self._print(finding)

    def _print(self, finding: Finding) -> None:
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
