"""What ``zv doctor`` says of a namespace, asked in the process of the tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import zenoh

from tests.support.listening import ask
from tests.support.processes import ROOT
from tests.support.standing_in import StandIn
from tests.support.waiting import DEADLINE_S
from zenoh_vision.errors import VisionError
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.declarations import Sessions
from zv.tools.doctor.command import run
from zv.tools.doctor.observation import Observation
from zv.tools.doctor.options import DoctorOptions
from zv.tools.shared.discovery import Discovery
from zv.tools.shared.output import Output

SMALL = ("--width", 160, "--height", 120)
GOOD_FILE = str(ROOT / "configs" / "edge.toml")

SECOND_S = 0.1
"""Of a stand-in."""

WATCH_S = 3 * SECOND_S
"""Over so long it has made several reports."""

Stand = Callable[..., StandIn]


class Kept(Output):
    """Keeps what would be printed."""

    def __init__(self) -> None:
        super().__init__(as_json=True)
        self.records: list[Mapping[str, Any]] = []

    def record(self, fields: Mapping[str, Any]) -> None:
        self.records.append(fields)

    def note(self, text: str) -> None:
        """Say nothing."""


class Diagnosis:
    """What the doctor says of a namespace."""

    def __init__(
        self,
        endpoint: str,
        namespace: str,
        *files: str,
        for_s: float = 0.0,
        timeout_s: float = DEADLINE_S,
    ) -> None:
        output = Kept()
        self.error: VisionError | None = None
        # Without a check of the range: where nothing is compared over time, one look is enough.
        options = DoctorOptions.model_construct(files=files or (GOOD_FILE,), for_=for_s)
        try:
            run(options, Connection(endpoint, namespace, timeout_s=timeout_s), output)
        except VisionError as error:
            self.error = error
        self.found = output.records

    def of(self, check: str) -> list[tuple[str, str, str]]:
        """Return level, text and remedy of a check's lines."""
        return [(f["level"], f["text"], f["remedy"]) for f in self.found if f["check"] == check]

    @property
    def troubles(self) -> set[tuple[str, str]]:
        """Level and check of all that is not OK."""
        return {(f["level"], f["check"]) for f in self.found if f["level"] != "OK"}


def levels(session: zenoh.Session, namespace: str, node: str) -> list[int]:
    return [each.body["level"] for each in ask(session, f"@{namespace}/diagnostics/{node}")]


def observation(*nodes: NodeState, publishers: Sessions | None = None, **more: Any) -> Observation:
    """Return what zv doctor has seen: these nodes."""
    described = tuple(each.description for each in nodes if each.description)
    discovery = Discovery(described, publishers or {}, {}, answered=True)
    known = {"routers": {}, "reached": (), "parameters": {}}
    return Observation(**{**known, **more}, nodes=list(nodes), discovery=discovery)
