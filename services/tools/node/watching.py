"""``zv node list --watch``: who comes and who goes."""

from __future__ import annotations

import threading

import zenoh

from common.keys import node_key
from common.session import direct
from services.tools.facts import facts
from services.tools.namespaces import nobody_here
from services.tools.nodes import Presence, present
from services.tools.output import Output
from services.tools.session import ToolSession

LOOK_AGAIN_S = 1.0
"""A second node of a name shows no token of its own, so it is asked who answers."""

SETTLE_S = 0.05
"""Who starts or ends together is told together."""

FIRST_S = 0.3
"""The tokens that are there come at once."""


class Attendance:
    """Who was there when last looked, and what has changed since."""

    def __init__(self) -> None:
        self._there: dict[tuple[str, str | None], Presence] = {}

    def update(self, found: list[Presence]) -> tuple[list[Presence], list[Presence]]:
        """Take who is there now; return who came and who went.

        A node that does not answer once, though its name is there, has not gone: unless another
        of that name answers, it may be busy.
        """
        silent = {each.name for each in found if each.session is None}
        now = {(each.name, each.session): each for each in found}
        for who, known in self._there.items():
            if known.name in silent and known.session is not None:
                now.pop((known.name, None), None)
                now[who] = known
        came = [each for who, each in now.items() if who not in self._there]
        went = [each for who, each in self._there.items() if who not in now]
        self._there = now
        return came, went


class Tokens:
    """The names whose tokens are there, as Zenoh tells it.

    Args:
        session: Of the tool.
    """

    def __init__(self, session: ToolSession) -> None:
        self.changed = threading.Event()
        self._names: frozenset[str] = frozenset()
        session.link.declare(
            lambda opened: opened.liveliness().declare_subscriber(
                node_key(session.namespace, "*"), direct(self._on_sample), history=True
            )
        )

    def take(self) -> frozenset[str]:
        """Return the names there are now; ``changed`` is set when there are others."""
        self.changed.clear()
        return self._names

    def _on_sample(self, sample: zenoh.Sample) -> None:
        name = {str(sample.key_expr).rpartition("/")[2]}
        gone = sample.kind == zenoh.SampleKind.DELETE
        self._names = self._names - name if gone else self._names | name
        self.changed.set()


def watch(session: ToolSession, output: Output) -> None:
    """Print a line for each node that comes or goes, until told to stop."""
    tokens = Tokens(session)
    attendance = Attendance()
    session.wait(FIRST_S, tokens.changed.is_set)
    if not tokens.changed.is_set():
        output.note(nobody_here(session))
    while not session.stopping:
        session.wait(SETTLE_S)
        came, went = attendance.update(present(session, tokens.take()))
        if session.stopping:
            break
        for each in went:
            _say(output, "gone", each)
        for each in came:
            _say(output, "here", each)
        session.wait(LOOK_AGAIN_S, tokens.changed.is_set)


def _say(output: Output, event: str, presence: Presence) -> None:
    about = facts(presence)
    if output.as_json:
        output.record({"event": event, **about})
        return
    who = f"{about['service']} {about['version']} on {about['host']}, pid {about['pid']}"
    output.line(f"{event}  {presence.name}  {who if about['answers'] else 'does not answer'}")
