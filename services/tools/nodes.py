"""Who is there: nodes by their liveliness tokens, with what each says of itself.

Two nodes of one name have one token between them, so nodes are told apart by the sessions that
answer.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from typing import TypeVar

from common import keys
from common.codec import Message
from common.errors import ExpectationNotMet, PayloadError, ToldToStop, VisionError
from common.messages import Diagnostics, NodeDescription, Parameter
from services.tools.asking import EVERY_ANSWER, Answer, Question
from services.tools.nearest import nothing_matches
from services.tools.session import ANSWER_S, ToolSession

M = TypeVar("M", bound=Message)

SILENT = "shows its token but does not answer"
"""What is said of a node that is there and says nothing."""


@dataclass(frozen=True, slots=True)
class Clock:
    """How far a node's clock is ahead of ours, as a round trip tells it.

    Attributes:
        ahead_ns: Nanoseconds; below 0 it is behind.
        error_ns: Half the round trip: it may be off by so much.
    """

    ahead_ns: int
    error_ns: int


@dataclass(frozen=True, slots=True)
class Presence:
    """One node that runs, or a name under which nobody answers.

    Attributes:
        name: Of the node.
        session: Zenoh id of the session that answered; None if none did in time.
        description: What it says of itself.
        clock: Compared with ours, if it said when it answered.
        report: The newest health that it answered.
    """

    name: str
    session: str | None = None
    description: NodeDescription | None = None
    clock: Clock | None = None
    report: Diagnostics | None = None

    @property
    def silent_s(self) -> float | None:
        """Seconds since its newest report, by its own clock; None if it made none."""
        if self.report is None or self.description is None:
            return None
        now_ns = self.description.stamp_ns or time.time_ns()
        return max(0, now_ns - self.report.stamp_ns) / 1e9

    @property
    def uptime_s(self) -> float | None:
        """Seconds since its start, by its own clock."""
        if self.description is None:
            return None
        now_ns = self.description.stamp_ns or time.time_ns()
        return max(0, now_ns - self.description.started_ns) / 1e9


def every_answer_on(session: ToolSession, key: str, timeout_s: float = ANSWER_S) -> Question:
    """Return a query that all nodes may answer, equal names or not."""
    return lambda handler: session.link.session.get(key, handler, timeout=timeout_s, **EVERY_ANSWER)


def tokens_of(session: ToolSession, namespace: str, node: str = "*") -> Question:
    """Return the question which nodes show their token."""
    key = keys.node_key(namespace, node)
    return lambda handler: session.link.session.liveliness().get(key, handler, timeout=ANSWER_S)


def present(session: ToolSession, living: Collection[str] | None = None) -> list[Presence]:
    """Return every node that runs, by name and start; those that do not answer too.

    Args:
        session: Of the tool.
        living: Names whose tokens are there, for who subscribes to tokens: beside such a
            subscription Zenoh 1.10 leaves tokens out of the answer to who asks for them.
    """
    answers, reports, *tokens = session.gather(
        every_answer_on(session, keys.node_key(session.namespace, "*")),
        every_answer_on(session, keys.diagnostics_key(session.namespace, "*")),
        *([tokens_of(session, session.namespace)] if living is None else []),
    )
    if living is None:
        living = {answer.name for answer in tokens[0]}
    described = [
        Presence(answer.name, answer.session, description, _clock(answer, description))
        for answer, description in read(answers, NodeDescription)
        if answer.name in living  # the others ended while we asked
    ]
    health = {(a.name, a.session): report for a, report in read(reports, Diagnostics)}
    found = [
        replace(each, report=health.get((each.name, each.session or ""))) for each in described
    ]
    found += [Presence(name) for name in set(living) - {each.name for each in described}]
    return sorted(found, key=_order)


def _order(presence: Presence) -> tuple[str, int, str]:
    started_ns = presence.description.started_ns if presence.description else 0
    return presence.name, started_ns, presence.session or ""


def read(answers: Iterable[Answer], message: type[M]) -> Iterable[tuple[Answer, M]]:
    """Yield the answers that hold a message of a type; what does not is not one of ours."""
    for answer in answers:
        try:
            yield answer, message.from_bytes(answer.sample.payload.to_bytes())
        except PayloadError:
            continue


def _clock(answer: Answer, description: NodeDescription) -> Clock | None:
    if description.stamp_ns is None:
        return None
    middle_ns = (answer.asked_ns + answer.answered_ns) // 2
    return Clock(
        ahead_ns=description.stamp_ns - middle_ns,
        error_ns=(answer.answered_ns - answer.asked_ns) // 2,
    )


def parameters(session: ToolSession, node: str) -> dict[str, list[Parameter]]:
    """Return the parameters of the nodes that answer, by the session of each.

    Args:
        session: Of the tool.
        node: Its name, ``*`` for all nodes.
    """
    key = keys.parameter_key(session.namespace, node, "*")
    (answers,) = session.gather(every_answer_on(session, key))
    found: dict[str, list[Parameter]] = {}
    for answer, parameter in read(answers, Parameter):
        found.setdefault(answer.session, []).append(parameter)
    return {who: sorted(those, key=lambda one: one.name) for who, those in found.items()}


def absent(session: ToolSession, node: str, asked_for: str) -> VisionError:
    """Return the error for a node that did not answer: it is not there, or it is silent.

    Args:
        session: Of the tool.
        node: Its name.
        asked_for: What it was asked for, ``parameters``.
    """
    (tokens,) = session.gather(tokens_of(session, session.namespace))
    if session.stopping:
        return ToldToStop("told to stop while waiting for an answer")
    living = {answer.name for answer in tokens}
    if node in living:
        return ExpectationNotMet(f"{node} runs, but does not answer for {asked_for}")
    return ExpectationNotMet(nothing_matches(node, living, kind="node"))
