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
"""A node shows its token last of all, but its router may tell of it first."""


class Attendance:
    """Who was there when last looked, and what has changed since."""

    def __init__(self) -> None:
        self._there: dict[tuple[str, str | None], Presence] = {}

    @property
    def anyone(self) -> bool:
        """Whether anyone was there when last looked."""
        return bool(self._there)

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


def watch(session: ToolSession, output: Output) -> None:
    """Print a line for each node that comes or goes, until told to stop."""
    changed = threading.Event()

    def on_token(_: zenoh.Sample) -> None:
        changed.set()

    tokens = session.zenoh.liveliness().declare_subscriber(
        node_key(session.namespace, "*"), direct(on_token), history=True
    )
    attendance = Attendance()
    noted = False
    with tokens:
        while not session.stopping:
            changed.clear()
            came, went = attendance.update(present(session))
            if session.stopping:
                break
            if not (attendance.anyone or noted):
                output.note(nobody_here(session))
            noted = True
            for each in went:
                _say(output, "gone", each)
            for each in came:
                _say(output, "here", each)
            session.wait(LOOK_AGAIN_S, changed.is_set)
            if changed.is_set():
                session.wait(SETTLE_S)


def _say(output: Output, event: str, presence: Presence) -> None:
    about = facts(presence)
    if output.as_json:
        output.record({"event": event, **about})
        return
    who = f"{about['service']} {about['version']} on {about['host']}, pid {about['pid']}"
    output.line(f"{event}  {presence.name}  {who if about['answers'] else 'does not answer'}")
