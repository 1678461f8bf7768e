"""Finds out what a router denies: Zenoh drops it silently, so that it looks as if nobody cared.

For each key that it declares, a node shows a liveliness token on a key of its own, and asks for its
tokens. A router allows a holder the tokens of just those keys that it may declare, and answers with
those that it took. If it did not even take that of the holder's own queryable, it knows no such
holder. The declarations on keys with ``@`` are not shown, so the node's token is judged by the
rights in the holder's file.

The router's lists of what was declared tell that too, but who asks for them while somebody declares
something, as all do when a router is back, can lock it up (zenoh #2619).

The holder's queryable answers with what is denied. So others can find it out of a node that may say
nothing else.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Final

import zenoh

from zenoh_vision import keys
from zenoh_vision.error_text import joined
from zenoh_vision.security.credentials import Credentials
from zenoh_vision.security.rights import Action
from zenoh_vision.transport.declarations import Kind
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.query import Query, Replies, send
from zenoh_vision.transport.session import direct

CHECK_S: Final = 3.0
SETTLED_S: Final = 60.0
"""Until a router that denies nothing is asked again, unless something has changed."""

CHANGED_S: Final = 0.5
"""Until a router is asked what it makes of a change."""

ANSWER_S: Final = 10.0
"""Long, since a router that is too slow for all questions would be slower if they were repeated."""

MOST_SHOWN: Final = 4

MEND: Final = "give --credentials of another name, or add to its rights with zv security add"

Declared = tuple[Kind, str]


def declare_holder(
    link: Link, credentials: Credentials, denied: Callable[[], str] = lambda: ""
) -> None:
    """Show at the router whose certificate a session has, which routers do not tell otherwise.

    ``denied`` returns what to answer to who asks what is denied; nothing if that is empty.
    """
    key = keys.holder_key(credentials.name)

    def answer(query: zenoh.Query) -> None:
        with query:
            if said := denied():
                query.reply(key, said)

    link.declare(lambda session: session.declare_queryable(key, direct(answer)))


class AccessCheck:
    """Compares what a node declares with what its router has accepted.

    Attributes:
        credentials: Whose rights these are; those of a renewed file take their place.
        denied: What the router denies, and what to do; empty if that is nothing, or unknown.
    """

    def __init__(self, link: Link, credentials: Credentials) -> None:
        self.denied = ""
        self._link = link
        self.credentials = credentials
        self._own = keys.holder_key(credentials.name)
        self._shown: dict[Declared, Declaration[zenoh.LivelinessToken]] = {}
        self._due_s = math.inf
        self._connection: object = None
        self._state: object = None
        self._asked: set[Declared] = set()
        self._asked_s = 0.0
        self._answer: Future[Replies] | None = None
        self._suspected: set[Declared] = set()
        self._own_token = ""
        declare_holder(link, credentials, lambda: self.denied)

    def check(self, announces: str) -> None:
        """Ask the router again if that is due; returns at once. Call about once a second.

        It is due after the connection, what is declared or the file has changed, every few seconds
        while something is denied, and otherwise once a minute.

        Args:
            announces: Key of the node's token.
        """
        self._own_token = announces
        session, routers = self._link.session, self._link.routers()
        if not routers:
            self._connection = None
            return
        wanted, own, now_s = self._declared(), str(session.zid()), time.monotonic()
        if (own, routers) != self._connection:
            self._connection, self._state = (own, routers), None
            self._answer, self._suspected, self._due_s = None, set(), math.inf
        if self._answer is not None and self._answer.done():
            self._due_s = self._asked_s + self._note(self._answer.result(), own, wanted)
            self._answer = None
        state = (wanted, self.credentials)
        if self._answer is None and state != self._state:
            self._state, self._due_s = state, min(self._due_s, now_s + CHANGED_S)
        is_due = now_s >= self._due_s
        # The more tokens there are, the longer a router takes for each question.
        self._show(wanted if is_due or self._answer is not None else set())
        if is_due:
            self._asked, self._asked_s, self._due_s = wanted, now_s, math.inf
            self._answer = Future()
            pattern = keys.granted_key(self.credentials.name, own, "*", "**")
            query = Query(pattern, timeout_s=ANSWER_S, tokens=True)
            # Zenoh calls this with the session locked: judging the answer there could wait for ever
            # for a thread that uses the session.
            send(session, query, self._answer.set_result)

    def _declared(self) -> set[Declared]:
        return {(kind, key) for kind, key in self._link.declared() if "/@" not in f"/{key}"}

    def _show(self, wanted: set[Declared]) -> None:
        """Show a token for each of these, and no others."""
        for gone in self._shown.keys() - wanted:
            self._link.undeclare(self._shown.pop(gone))
        for new in wanted - self._shown.keys():
            self._shown[new] = self._link.declare(partial(self._token, new))

    def _token(self, shown: Declared, session: zenoh.Session) -> zenoh.LivelinessToken:
        key = keys.granted_key(self.credentials.name, str(session.zid()), *shown)
        return session.liveliness().declare_token(key)

    def _note(self, replies: Replies, own: str, wanted: set[Declared]) -> float:
        """Note what the router has accepted; return how long after the question to ask again."""
        name = self.credentials.name
        is_complete = not replies.timed_out and not replies.left_out
        taken = {reply.key for reply in replies if not reply.own}
        # What was undeclared meanwhile, as when another route takes over, is not denied; nor is
        # what the file grants and is missing once only, as while the router starts again.
        asked = self._asked & wanted
        denied = {each for each in asked if keys.granted_key(name, own, *each) not in taken}
        missing = denied if is_complete else self._suspected
        confirmed = {each for each in missing if each in self._suspected or not self._grants(*each)}
        self._suspected, is_sure = missing, is_complete and missing == confirmed
        if not is_sure:
            return 0.0
        self.denied = self._words(missing)
        return CHECK_S if self.denied else SETTLED_S

    def _grants(self, kind: Kind, key: str) -> bool:
        """Tell whether the file grants what somebody declares, whatever the router does."""
        action: Action = "subscribe" if kind == "subscriber" else "answer"
        return self.credentials.rights.granting(action, key) is not None

    def _words(self, missing: set[Declared]) -> str:
        rights = self.credentials.rights
        denied = sorted({(_action(kind), key) for kind, key in missing})
        if rights.granting("announce", self._own_token) is None:
            denied.insert(0, ("announce", self._own_token))
        if not denied:
            return ""
        name, folder = self.credentials.name, self.credentials.path.parent
        if ("queryable", self._own) in missing:
            return (
                f"the router gives {name} no rights: its certificate was revoked, or the router "
                f"runs with the rules of another system; zv security show --dir {folder}"
            )
        shown = joined((f"{action} {key}" for action, key in denied), MOST_SHOWN)
        action, key = denied[0]
        if rights.granting(action, key) is None:
            why = f"no rule allows it to the certificate of {name}: {MEND}"
        else:
            why = f"its rules are older than the file of {name}: give the router the new ones"
        return (
            f"the router denies: {shown}; {why}; "
            f"zv security check {name} {key} {action} --dir {folder}"
        )


def _action(kind: Kind) -> Action:
    """Return what is denied if a declaration is; a stream has a queryable too."""
    return "subscribe" if kind == "subscriber" else "publish"
