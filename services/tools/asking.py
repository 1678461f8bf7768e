"""Questions to whoever answers, several at once: each reply with the times around it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import zenoh

POLL_S = 0.05

EVERY_ANSWER: dict[str, Any] = {
    "target": zenoh.QueryTarget.ALL,
    "consolidation": zenoh.ConsolidationMode.NONE,
}
"""Without it Zenoh asks the nearest, and hands out one answer for a key, however many there are."""

Question = Callable[[Any], object]
"""Called with a handler for the replies."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A reply and the times around it, ns since 1970 by our clock."""

    reply: zenoh.Reply
    asked_ns: int
    answered_ns: int

    @property
    def session(self) -> str:
        """Zenoh id of who answered."""
        return "" if self.reply.replier_id is None else str(self.reply.replier_id.zid)

    @property
    def sample(self) -> zenoh.Sample:
        """What a good answer holds."""
        assert self.reply.ok is not None
        return self.reply.ok

    @property
    def name(self) -> str:
        """The last chunk of the key that a good answer is for: a node's name in its own keys."""
        return str(self.sample.key_expr).rpartition("/")[2]


def answers_to(questions: Iterable[Question], stopping: Callable[[], bool]) -> list[list[Answer]]:
    """Ask several questions at once and return the answers to each, refusals too.

    Args:
        questions: Each ends by itself, after its own time.
        stopping: Whether to wait no longer.
    """
    asked = [_begin(question) for question in questions]
    for _, done in asked:
        while not stopping() and not done.wait(POLL_S):
            pass
    return [[each for each in list(found) if not _is_timeout(each.reply)] for found, _ in asked]


def _begin(question: Question) -> tuple[list[Answer], threading.Event]:
    found: list[Answer] = []
    done = threading.Event()
    asked_ns = time.time_ns()

    def take(reply: zenoh.Reply) -> None:
        found.append(Answer(reply, asked_ns, time.time_ns()))

    question(zenoh.handlers.Callback(take, done.set, indirect=False))
    return found, done


def _is_timeout(reply: zenoh.Reply) -> bool:
    """Tell Zenoh's own word that someone did not answer from a node's refusal."""
    return reply.err is not None and reply.err.payload.to_bytes() == b"Timeout"
