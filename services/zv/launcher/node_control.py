"""Answers ``zv node stop``, ``start`` and ``restart`` for the nodes that ``zv up`` runs."""

from __future__ import annotations

import queue
import time
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Final, get_args

import msgpack
import zenoh

from zenoh_vision import keys
from zenoh_vision.error_text import shortened
from zenoh_vision.errors import ParameterRefused, PayloadError
from zenoh_vision.keys import LaunchVerb
from zenoh_vision.message_codec import unpack
from zv.launcher.child import Child

VERBS: Final = get_args(LaunchVerb)
ANSWER_S: Final = 2.0
"""How long after a node must have ended the request is answered."""

MOST_WAITING: Final = 64


@dataclass(slots=True)
class _Request:
    child: Child
    verb: LaunchVerb
    state: Future[str] = field(default_factory=Future)
    is_begun: bool = False


class NodeControl:
    """Carries out requests on the thread that supervises the processes.

    The processes are known by the names of their nodes. One that has not ended after ``grace_s`` is
    killed.
    """

    def __init__(self, namespace: str, children: Mapping[str, Child], grace_s: float) -> None:
        self._namespace = namespace
        self._children = children
        self._grace_s = grace_s
        self._new: queue.Queue[_Request] = queue.Queue(MOST_WAITING)
        self._open: list[_Request] = []

    def answer(self, query: zenoh.Query) -> None:
        """Answer a query on ``@{ns}/launch/{node}`` with the state of each node that it names.

        Its payload is the verb; without one nothing changes. Blocks until it is done.

        Raises:
            ParameterRefused: The payload is no verb, or several nodes are named.
        """
        keys_of = {
            zenoh.KeyExpr(keys.launch_key(self._namespace, name)): child
            for name, child in self._children.items()
        }
        named = [(key, one) for key, one in keys_of.items() if query.key_expr.intersects(key)]
        try:
            verb = None if query.payload is None else _verb(query.payload.to_bytes())
            if verb is not None and len(named) > 1:
                raise PayloadError("bad_message", "a change of several nodes at once")
        except PayloadError as error:
            allowed = f"one of {', '.join(VERBS)}, of one node"
            raise ParameterRefused(error.detail, allowed) from None
        for key, child in named:
            state = child.state if verb is None else self._done(child, verb)
            query.reply(key, msgpack.packb(state), encoding="application/msgpack")

    def step(self) -> None:
        """Begin what was requested, and finish what is done; on the supervisor's thread."""
        while not self._new.empty():
            self._open.append(self._new.get_nowait())
        for request in tuple(self._open):
            if self._is_done(request):
                self._open.remove(request)
                request.state.set_result(request.child.state)

    def _is_done(self, request: _Request) -> bool:
        child = request.child
        if request.verb == "start":
            if not child.alive:
                child.start()
            return True
        if not request.is_begun:
            request.is_begun = True
            child.hold(time.monotonic() + self._grace_s)
        if child.pid is not None:
            return False
        if request.verb == "restart":
            child.start()
        return True

    def _done(self, child: Child, verb: LaunchVerb) -> str:
        request = _Request(child, verb)
        try:
            self._new.put_nowait(request)
            return request.state.result(self._grace_s + ANSWER_S)
        except (queue.Full, TimeoutError):
            return child.state


def _verb(payload: bytes) -> LaunchVerb:
    """Return the verb in a payload.

    Raises:
        PayloadError: ``bad_message``: it is none.
    """
    found = unpack(payload)
    if found not in VERBS:
        raise PayloadError("bad_message", f"{shortened(found)} is no change of a node")
    return found  # type: ignore[return-value]
