"""Subscribes to a camera's frames by the key on which they flow: compressed, else raw pixels."""

from __future__ import annotations

import time
from typing import Any

import zenoh

from zenoh_vision.keys import Transport
from zenoh_vision.stream.frame_intake import FrameIntake
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.subscriber import subscribe

SILENT_NS = 3_000_000_000
"""After this time without a frame, ``auto`` subscribes to the raw pixels too: longer than a camera
of our own takes to start, which then makes no raw pixels in vain."""


class TransportSwitch:
    """The subscriptions of one input, to the compressed frames of a camera, the raw ones, or both.

    With ``auto`` the compressed key is always subscribed to, which costs nothing while nobody
    publishes on it. Raw pixels are ten times as large, and a camera that has both makes each only
    for subscribers: they are subscribed to only while nothing compressed arrives. Once a compressed
    frame arrives, they are unsubscribed from. The routers' list of publishers would tell sooner
    which of the two is published, but Zenoh 1.10 can hang a router that is asked for it while a
    publisher is being declared. ``follow`` does not wait for the network.

    Args:
        link: To the router.
        intake: Takes the samples of both keys; its ``key`` is the compressed one.
        raw_key: Key of the raw pixels.
    """

    def __init__(self, link: Link, intake: FrameIntake, raw_key: str) -> None:
        self._link = link
        self._intake = intake
        self._raw_key = raw_key
        self._subscriptions: dict[str, Declaration[zenoh.Subscriber[Any]]] = {}
        self._falls_back = False

    def follow(self, transport: Transport) -> None:
        """Subscribe and unsubscribe as a transport and what has arrived need it."""
        compressed, raw = transport != "raw", transport == "raw"
        if transport == "auto":
            self._follow_what_flows(time.monotonic_ns())
            raw = self._falls_back
        wanted = {self._intake.key: compressed, self._raw_key: raw}
        for key, is_wanted in wanted.items():
            if is_wanted and key not in self._subscriptions:
                self._subscriptions[key] = subscribe(self._link, self._intake, key)
            elif not is_wanted and key in self._subscriptions:
                self._subscriptions.pop(key).undeclare()
        self._intake.keys = tuple(key for key, is_wanted in wanted.items() if is_wanted)
        taken = {self._intake.key: transport != "raw", self._raw_key: transport != "jpeg"}
        self._intake.awaited = tuple(key for key, is_taken in taken.items() if is_taken)

    def undeclare(self) -> None:
        """End all subscriptions."""
        while self._subscriptions:
            self._subscriptions.popitem()[1].undeclare()

    def _follow_what_flows(self, now_ns: int) -> None:
        key, since_ns = self._intake.newest
        if now_ns - since_ns >= SILENT_NS:
            self._falls_back = True
        elif key != self._raw_key:
            self._falls_back = False
