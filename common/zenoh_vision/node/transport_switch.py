"""Switches between the transports of a camera's frames: shared memory, compressed, raw pixels."""

from __future__ import annotations

import time
from typing import Any

import zenoh

from zenoh_vision.keys import Transport
from zenoh_vision.node.shm_input import SharedMemoryInput
from zenoh_vision.stream.frame_intake import FrameIntake
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.subscriber import subscribe

SILENT_NS = 3_000_000_000
"""After this time without a frame, ``auto`` subscribes to the raw pixels too: longer than ``zv
camera`` takes to start, so that a camera that is just starting need not make raw pixels."""


LOOK_NS = 100_000_000
"""How often it is decided anew which transports to subscribe to."""


class TransportSwitch:
    """Subscribes one input to a camera's frames: to two keys and shared memory, as needed.

    With ``auto`` the compressed key is subscribed to, which costs nothing while nobody publishes on
    it. If frames flow through shared memory, that subscription ends, so that the camera need not
    encode them. Raw pixels over Zenoh are ten times as large, and a camera that has both makes each
    only for subscribers. So the raw key is subscribed to only after a silence, until a compressed
    frame arrives. The routers' list of publishers would show sooner which of the two is published,
    but Zenoh 1.10 can hang a router that is queried for it while a publisher is being declared.
    ``follow`` does not wait for the network.

    Args:
        link: To the router.
        intake: Takes the samples of all transports; its ``key`` is the compressed one.
        raw_key: Key of the raw pixels.
        memory: The camera's frames in shared memory; None if this process cannot take them.
        memory_by_itself: Whether ``auto`` includes shared memory.
    """

    def __init__(
        self,
        link: Link,
        intake: FrameIntake,
        raw_key: str,
        memory: SharedMemoryInput | None = None,
        *,
        memory_by_itself: bool = True,
    ) -> None:
        self._link = link
        self._intake = intake
        self._raw_key = raw_key
        self._memory = memory
        self._memory_transports = ("auto", "shm") if memory_by_itself else ("shm",)
        self._subscriptions: dict[str, Declaration[zenoh.Subscriber[Any]]] = {}
        self._falls_back = False
        self._followed: Transport | None = None
        self._look_ns = 0

    def follow(self, transport: Transport) -> None:
        """Subscribe and unsubscribe, by the chosen transport and the frames that have arrived.

        Called for each frame; what has arrived is looked at every ``LOOK_NS``.
        """
        now_ns = time.monotonic_ns()
        if transport == self._followed and now_ns < self._look_ns:
            return
        self._followed, self._look_ns = transport, now_ns + LOOK_NS
        if self._memory is not None:
            self._memory.follow(wanted=transport in self._memory_transports)
            self._intake.fault = self._memory.failure
        wanted = {self._intake.key: transport == "jpeg", self._raw_key: transport == "raw"}
        if transport == "auto":
            wanted = self._by_what_flows(now_ns)
        for key, is_wanted in wanted.items():
            if is_wanted and key not in self._subscriptions:
                self._subscriptions[key] = subscribe(self._link, self._intake, key)
            elif not is_wanted and key in self._subscriptions:
                self._subscriptions.pop(key).undeclare()
        # In the node's description, frames of shared memory are those of the compressed key.
        keys = tuple(key for key, is_wanted in wanted.items() if is_wanted)
        self._intake.keys = keys or (self._intake.key,)
        self._intake.awaited = {
            "auto": (self._intake.key, self._raw_key),
            "jpeg": (self._intake.key,),
            "raw": (self._raw_key,),
            "shm": (f"{self._raw_key} in shared memory",),
        }[transport]

    def undeclare(self) -> None:
        """End all subscriptions."""
        if self._memory is not None:
            self._memory.close()
        while self._subscriptions:
            self._subscriptions.popitem()[1].undeclare()

    def _by_what_flows(self, now_ns: int) -> dict[str, bool]:
        """Return for each key whether ``auto`` subscribes to it now."""
        key, since_ns = self._intake.newest
        flows = now_ns - since_ns < SILENT_NS
        if not flows:
            self._falls_back = True
        elif key != self._raw_key:
            self._falls_back = False
        receiving = self._memory is not None and self._memory.receiving
        if flows and receiving and self._intake.way == "shm":
            self._falls_back = False
            return {self._intake.key: False, self._raw_key: False}
        return {self._intake.key: True, self._raw_key: self._falls_back}
