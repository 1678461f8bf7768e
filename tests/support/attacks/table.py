"""The attacks: what a client at the same router sends to harm a system, each of it bounded.

``tests/attacks`` makes them on processes, ``tests/compose`` on containers with limited memory.
"""

from __future__ import annotations

import itertools
import random
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import msgpack
import numpy as np
import zenoh

from tests.support.containers import rogue
from tests.support.node_states import description, report
from tests.support.pictures.encoded import PICTURES, damaged, progressive
from tests.support.publishing import KEPT, Paced, PlainCamera, hostile_header
from tests.support.waiting import wait_until
from zenoh_vision.image import codecs

NODES = ("camera_front", "tracker_front", "edge_front", "viewer")
MB = 1_000_000
UNPUBLISHED_KEY = "vision/nowhere/image/compressed"
"""The observer asks the viewer for snapshots of it."""


class Attacker:
    """A client that attacks, and what it declared."""

    def __init__(self, session: zenoh.Session) -> None:
        self.session = session
        self.camera = PlainCamera(session, epoch=time.time_ns())
        self.random = random.Random(1)
        self.malformed = zip(itertools.cycle(rogue.keys()), rogue.malformed(), strict=False)
        self.kept: list[Any] = []
        self.answered = 0

    def put(self, key: str, fields: object) -> None:
        self.session.put(key, msgpack.packb(fields), congestion_control=KEPT)

    def picture(self, picture: bytes, **header: Any) -> None:
        """Publish a picture, by default as the first of a newer epoch."""
        changes = {"epoch": time.time_ns(), "seq": 0, **header}
        self.camera.put(picture, msgpack.packb(self.camera.header(PICTURES[0], **changes)))

    def ask(self, key: str, payload: bytes | None = None) -> None:
        """Send a query, and do not wait for its replies."""
        self.session.get(key, zenoh.handlers.RingChannel(1), payload=payload, timeout=1.0)

    def set(self, node: str, **values: Any) -> None:
        self.ask(f"@vision/set/{node}", msgpack.packb(values))

    def answer(self, key: str, say: Callable[[zenoh.Query], None]) -> None:
        """Answer queries on a key until the attack is over."""

        def on_query(query: zenoh.Query) -> None:
            with query:
                self.answered += 1
                say(query)

        handler = zenoh.handlers.Callback(on_query, indirect=False)
        self.kept.append(self.session.declare_queryable(key, handler))

    def token(self, node: str) -> None:
        """Show a node's token until the attack is over."""
        self.kept.append(self.session.liveliness().declare_token(f"@vision/node/{node}"))

    def end(self) -> None:
        for declared in self.kept:
            declared.undeclare()
        self.kept.clear()


Send = Callable[[Attacker, int], None]


@dataclass(frozen=True)
class Attack:
    """One attack.

    Attributes:
        send: Sends the message with a number.
        count: How many messages.
        rate_hz: At which rate, so that the attack is not over before it is felt.
        dropped: Under which reason tracker and edge detector count each message; empty where
            they may not even see it.
        is_costly: Whether it takes a service long to decode and use its pictures.
        is_asked: Whether it lies in answers, so that it lasts until one was given.
        repair: Takes back what others would have to take back too.
    """

    send: Send
    count: int = 25
    rate_hz: float = 50
    dropped: str = ""
    is_costly: bool = False
    is_asked: bool = False
    repair: Callable[[Attacker], None] = field(default=Attacker.end)


@cache
def deep(channels: int, height: int, width: int) -> bytes:
    """A PNG of 16 bits: small, since all its pixels are the same."""
    return codecs.encode_png(
        np.full((height, width, channels)[: 2 + (channels > 1)], 90, np.uint16)
    )


def sends(make: Callable[[], bytes], width: int, height: int, **header: Any) -> Send:
    """Return what sends a picture, made once, whose header has its size."""
    made = cache(make)
    return lambda attacker, _: attacker.picture(made(), width=width, height=height, **header)


def grey() -> bytes:
    """A grey JPEG of 8K: a few kB."""
    return codecs.encode_jpeg(np.full((4320, 7680), 90, np.uint8), "mono8", 80)


def endless_report(attacker: Attacker, number: int) -> None:
    """Report under a new name, with as many counters as a report may have."""
    for index in range(20):
        name = f"fake{number}_{index}"
        counters = {f"dropped.{name}_{c}_{'x' * 100}": c for c in range(100)}
        attacker.put(f"@vision/diagnostics/{name}", report(node=name, counters=counters).to_map())


def endless_tokens(attacker: Attacker, number: int) -> None:
    for index in range(80):
        attacker.token(f"a_fake{number}_{index}")


def endless_parameters(attacker: Attacker, number: int) -> None:
    """Publish parameters that a node does not have, each as large as one may be."""
    for index in range(20):
        name = f"p{number}_{index}"
        said = {"node": NODES[number % 4], "name": name, "type": "str", "value": "x" * 7000}
        attacker.put(
            f"@vision/param/{said['node']}/{name}", {**said, "default": None, "revision": 1}
        )


def tracks(attacker: Attacker, number: int) -> None:
    """Publish Tracks with an unknown field of 200 kB."""
    header = attacker.camera.header(PICTURES[0], seq=number)
    attacker.put("vision/front/tracks", {"header": header, "tracks": [], "more": ["x"] * 100_000})


def wrong_counters(attacker: Attacker, number: int) -> None:
    """Report for a node, with 25,000 counters that are none."""
    name = NODES[number % 4]
    fields = report(node=name).to_map() | {"counters": {f"c{n}": -1 for n in range(25_000)}}
    attacker.put(f"@vision/diagnostics/{name}", fields)


@cache
def of_25_000_keys(node: str) -> bytes:
    publishes = tuple(f"vision/front/{node}_{n}/compressed" for n in range(25_000))
    return description(node=node, publishes=publishes).to_bytes()


def long_descriptions(attacker: Attacker, number: int) -> None:
    """Announce a node that says it publishes 25,000 keys."""
    node = f"many{number % 5}_{number}"
    said = of_25_000_keys(node)
    attacker.answer(f"@vision/node/{node}", lambda query: query.reply(query.key_expr, said))
    attacker.token(node)


def schemas(attacker: Attacker, number: int) -> None:
    for _ in range(20):
        attacker.ask("@vision/schema/*")


def settings(attacker: Attacker, number: int) -> None:
    """Change every node's parameters, most of them in a way that costs work."""
    for _ in range(5):
        attacker.set("tracker_front", history=10 + number, closing=number % 20)
        attacker.set("edge_front", sigma=1.0 + number / 100)
        attacker.set("camera_front", noise=number % 50, quality=1 + number)
        attacker.set("viewer", quality=1 + number)


def usual_settings(attacker: Attacker) -> None:
    """Set all that the attacks have changed to what it was."""
    attacker.end()
    attacker.set("tracker_front", history=700, closing=20)
    attacker.set("edge_front", sigma=1.4)
    attacker.set("camera_front", **USUAL, noise=2.0, quality=80, faults="")
    attacker.set("viewer", quality=80)


USUAL = {"width": 320, "height": 240, "stall_after": 5.0, "reopen_min": 0.5, "reopen_max": 10.0}
"""Of the camera that is attacked."""


def reopening(attacker: Attacker, number: int) -> None:
    """Have the camera open larger and larger scenes again and again, and not wait for them."""
    size = ({"width": 7680, "height": 4320}, {"width": 1920 - number, "height": 1200})[number % 2]
    attacker.set("camera_front", **size, stall_after=0.1, reopen_min=0.01, reopen_max=0.01)


def faults(attacker: Attacker, number: int) -> None:
    kind = ("drop", "stall", "frozen")[number % 3]
    attacker.set("camera_front", faults=f"{kind}@now+{999_999 if number % 2 else 10**18}")


def nested(attacker: Attacker, number: int) -> None:
    """Send what is nested deeper than any parser should follow."""
    packed, text = b"\x91" * 60_000 + b"\xc0", b"[" * 60_000
    for node in NODES:
        attacker.ask(f"@vision/set/{node}", packed)
        attacker.session.put(f"@vision/diagnostics/{node}", packed)
    attacker.session.put("vision/front/tracks", packed)
    attacker.session.put("vision/front/tracks", text, encoding="application/json")
    attacker.camera.put(PICTURES[0], b"\x91" * 4000 + b"\xc0")


def endless_replies(attacker: Attacker, number: int) -> None:
    """Reply to each query for a picture that nobody publishes with 60 MB."""
    if not attacker.kept:
        picture = PICTURES[0] + bytes(MB)

        def say(query: zenoh.Query) -> None:
            for _ in range(60):
                query.reply(query.key_expr, picture)

        attacker.answer(UNPUBLISHED_KEY, say)


def anything(attacker: Attacker, number: int) -> None:
    """Send something malformed on every key, as sample and as query."""
    for _ in range(10):
        key, (payload, attachment) = next(attacker.malformed)
        attacker.session.put(key, payload, attachment=attachment, congestion_control=KEPT)
        if key.startswith("@"):
            attacker.ask(key, payload)


DEEP = {"encoding": "mono16"}
ATTACKS: dict[str, Attack] = {
    "scan bomb": Attack(
        sends(lambda: progressive(20_000, 7680, 4320), 7680, 4320, **DEEP), dropped="too_large"
    ),
    "JPEG with as many scans as allowed": Attack(
        sends(lambda: progressive(100, 1920, 1080), 1920, 1080), is_costly=True
    ),
    "grey JPEG of 8K": Attack(sends(grey, 7680, 4320, **DEEP), dropped="too_large"),
    "PNG of 16 bits of 8K": Attack(
        sends(lambda: deep(1, 4320, 7680), 7680, 4320, **DEEP), dropped="too_large"
    ),
    "costliest PNG for the tracker": Attack(
        sends(lambda: deep(4, 1200, 1920), 1920, 1200, **DEEP), is_costly=True
    ),
    "costliest PNG for edge detector and viewer": Attack(
        sends(lambda: deep(4, 2304, 4096), 4096, 2304, **DEEP), is_costly=True
    ),
    "100 MB on the image key": Attack(
        lambda attacker, _: attacker.picture(PICTURES[0] + bytes(100 * MB)),
        count=2,
        rate_hz=2,
        dropped="too_large",
    ),
    "140 MB, over the limit of a message": Attack(
        lambda attacker, _: attacker.picture(PICTURES[0] + bytes(140 * MB)), count=2, rate_hz=2
    ),
    "corrupt frames whose seq jumps": Attack(
        lambda attacker, number: attacker.picture(
            damaged(PICTURES[0]),
            epoch=attacker.camera.epoch + 10**12,
            seq=(0, 2**63, 2**64 - 1)[number % 3],
        ),
        rate_hz=100,
    ),
    "hostile headers": Attack(
        lambda attacker, _: attacker.picture(
            PICTURES[0], **hostile_header(attacker.random, attacker.camera)
        ),
        count=100,
        rate_hz=200,
    ),
    "malformed on every key": Attack(anything, count=60, rate_hz=60),
    "endless tokens": Attack(endless_tokens),
    "endless names of nodes": Attack(endless_report),
    "endless names of parameters": Attack(endless_parameters),
    "Tracks with 200 kB of an unknown field": Attack(tracks),
    "reports with 25,000 wrong counters": Attack(wrong_counters),
    "descriptions of 25,000 keys": Attack(long_descriptions, is_asked=True),
    "flood of schema queries": Attack(schemas),
    "flood of parameter sets": Attack(settings, repair=usual_settings),
    "nested without end": Attack(nested),
    "endless replies for a picture": Attack(endless_replies, count=10, is_asked=True),
    "camera reopening large scenes": Attack(reopening, repair=usual_settings),
    "faults without end": Attack(faults, repair=usual_settings),
}


def run(session: zenoh.Session, attack: Attack) -> None:
    """Make an attack from a session, until the router has taken all of it."""
    attacker = Attacker(session)
    numbers = iter(range(attack.count))

    def send() -> None:
        number = next(numbers, None)
        if number is not None:
            attack.send(attacker, number)

    with (pace := Paced(attack.rate_hz, send)):
        wait_until(
            lambda: pace.calls >= attack.count and (attacker.answered or not attack.is_asked)
        )
    attack.repair(attacker)
    # It ends after all that was sent before. Of what no router lists: while something is declared,
    # a router that replies may lock up (zenoh #2619).
    list(session.get("@/*/router/queryable/nothing", timeout=10.0))


@contextmanager
def under(session: zenoh.Session, attack: Attack) -> Iterator[None]:
    """Make an attack without pause while the context lasts."""
    attacker, numbers = Attacker(session), itertools.cycle(range(attack.count))
    with Paced(attack.rate_hz, lambda: attack.send(attacker, next(numbers))) as pace:
        wait_until(lambda: pace.calls)
        yield
    attack.repair(attacker)
