"""The rights of each holder of a certificate, derived from registry, topic table and keys."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from zenoh_vision import keys
from zenoh_vision.config.settings import ALL_CAMERAS
from zenoh_vision.security.rights import Action, Rights
from zenoh_vision.topics import COMPRESSED, RAW, topic_named
from zenoh_vision.transport.declarations import ROUTERS, Kind, declared_key
from zv.registry import EVERY_TOPIC, SERVICES

OPERATOR: Final = "operator"
GUEST: Final = "guest"
LAUNCHER: Final = "launcher"
"""``zv up``, which sees all nodes and stops and starts those that it runs."""
PLAYER: Final = "player"
"""``zv bag play``, which sends what was recorded of its cameras as if it were of them."""
ROUTER: Final = "router"
OWN_NODE: Final = "node"
KINDS: Final = frozenset({OPERATOR, GUEST, LAUNCHER, PLAYER, ROUTER, OWN_NODE, *SERVICES})

LISTED: Final[tuple[Kind, ...]] = ("publisher", "subscriber", "queryable")
"""What the routers list about each key."""

Pairs = Iterator[tuple[Action, Iterable[str]]]


@dataclass(frozen=True, slots=True)
class Role:
    """What somebody is, from which follows what it may do.

    Attributes:
        kind: A service of the registry, ``OPERATOR``, ``GUEST``, ``LAUNCHER``, ``PLAYER``,
            ``ROUTER`` or ``OWN_NODE``.
        cameras: Those that a service of the registry serves, or a player sends.
        publishes: Keys that a node of one's own publishes.
        subscribes: Key expressions that a node of one's own subscribes to.
    """

    kind: str
    cameras: tuple[str, ...] = ()
    publishes: tuple[str, ...] = ()
    subscribes: tuple[str, ...] = ()


def within(namespace: str) -> tuple[str, str]:
    """Return the key expressions that include every key of a namespace."""
    return f"{namespace}/**", f"@{namespace}/**"


def rights_of(name: str, role: Role, namespace: str) -> Rights:
    """Return what somebody of a name and a role may do in a namespace."""
    return Rights.of(_pairs(name, role, namespace))


def _pairs(name: str, role: Role, namespace: str) -> Pairs:
    yield from _every_holder(name)
    if role.kind in (OPERATOR, GUEST, LAUNCHER):
        yield from _observer(namespace)
        if role.kind == LAUNCHER:
            yield "answer", [keys.launch_key(namespace, "*")]
        if role.kind == OPERATOR:
            yield from _setter(namespace)
    elif role.kind == OWN_NODE:
        yield from _node(name, namespace, role.publishes, role.subscribes)
    elif role.kind == PLAYER:
        yield from _player(name, namespace, role.cameras)
    else:
        yield from _service(name, role, namespace)


def _service(name: str, role: Role, namespace: str) -> Pairs:
    """Yield what a node of the registry needs, for its cameras."""
    service = SERVICES[role.kind]
    cameras = role.cameras or (ALL_CAMERAS,)
    consumed = [each for each in service.consumes if each != EVERY_TOPIC]
    if not service.publishes and service.of_several:
        cameras = (ALL_CAMERAS,)  # it subscribes to those of all cameras, and chooses then
    # What it consumes is another node's: a relay must not send frames as the camera itself.
    own = [each for each in service.publishes if each not in service.consumes]
    publishes = _keys(namespace, cameras, own)
    yield from _node(name, namespace, publishes, _keys(namespace, cameras, consumed))
    if EVERY_TOPIC in service.consumes:
        yield from _observer(namespace)
        yield from _memory_consumer(namespace, (ALL_CAMERAS,))
    if service.records:
        yield "answer", [keys.record_key(namespace, name)]
    if service.sets:
        yield "query", [f"{keys.set_key(namespace, '*')}/**"]


def _player(name: str, namespace: str, cameras: Iterable[str]) -> Pairs:
    """Yield what it takes to send everything that was recorded of some cameras."""
    yield from _observer(namespace)
    everything = [f"{namespace}/{camera}/**" for camera in cameras]
    # Its node has the name of a camera if the recording has one.
    for node in (name, *(f"{name}_{camera}" for camera in cameras)):
        yield from _node(node, namespace, everything, ())


def _keys(namespace: str, cameras: Iterable[str], suffixes: Iterable[str]) -> list[str]:
    topics = [topic_named(suffix) for suffix in suffixes]
    return [topic.key(namespace, camera) for camera in cameras for topic in topics]


def _every_holder(name: str) -> Pairs:
    """Yield what every holder needs to find out whether the router grants what it needs."""
    yield "answer", [keys.holder_key(name)]
    yield "watch", [keys.LINK, keys.granted_key(name, "*", "*", "**")]


def _listable(namespace: str) -> tuple[str, ...]:
    return (*within(namespace), keys.holder_key("*"))


def _node(name: str, namespace: str, publishes: Iterable[str], subscribes: Iterable[str]) -> Pairs:
    """Yield what a node needs for itself, its streams and its inputs."""
    own, health = keys.node_key(namespace, name), keys.diagnostics_key(namespace, name)
    yield "announce", [own]
    yield "publish", [*publishes, health, keys.parameter_key(namespace, name, "*")]
    yield "answer", [*publishes, health, own]
    yield "answer", [f"{keys.parameters_key(namespace, name)}/**"]
    yield "answer", [f"{keys.set_key(namespace, name)}/**", keys.schema_key(namespace, "*")]
    # Its own health and description show whether another node has its name.
    yield "subscribe", [*subscribes, health]
    yield "query", [*subscribes, own]
    pictures = {COMPRESSED.name, RAW.name}
    for key in publishes:
        if keys.suffix_of(key) in pictures:
            offers = keys.shared_memory_key(namespace, keys.camera_of(key), "*", "*")
            yield "announce", [offers]
    yield from _memory_consumer(
        namespace, (keys.camera_of(key) for key in subscribes if keys.suffix_of(key) in pictures)
    )


def _memory_consumer(namespace: str, cameras: Iterable[str]) -> Pairs:
    """Yield what it takes to ask a camera for its frames in shared memory."""
    for camera in cameras:
        offers = keys.shared_memory_key(namespace, camera, "*", "*")
        yield "watch", [offers]
        yield "subscribe", [offers]


def _observer(namespace: str) -> Pairs:
    """Yield what it takes to see everything of a system, and to change nothing."""
    data = f"{namespace}/**"
    nodes, health = keys.node_key(namespace, "*"), keys.diagnostics_key(namespace, "*")
    yield "subscribe", [data, health, keys.parameter_key(namespace, "*", "*")]
    yield "query", [data, nodes, health, f"{keys.parameters_key(namespace, '*')}/**"]
    yield "query", [keys.schema_key(namespace, "*"), ROUTERS, keys.holder_key("*")]
    # All keys, so that a wrong namespace can be told.
    every = ("**", *_listable(namespace))
    yield "query", [declared_key(kind, each) for kind in LISTED for each in every]
    yield "watch", [nodes, keys.shared_memory_key(namespace, "*", "*", "*")]


def _setter(namespace: str) -> Pairs:
    """Yield what it takes to set parameters, to stop and start nodes, and to have them record."""
    yield "query", [f"{keys.set_key(namespace, '*')}/**", keys.launch_key(namespace, "*")]
    yield "query", [keys.record_key(namespace, "*")]
    yield "answer", [keys.record_key(namespace, "*")]  # of ``zv bag record``


def router_keys(namespace: str) -> list[str]:
    """Return the key expressions of what routers pass to each other.

    Not the tokens below a holder's key, which only its own router is asked for.
    """
    listable = _listable(namespace)
    listed = [declared_key(kind, each) for kind in LISTED for each in listable]
    return [*listable, keys.LINK, ROUTERS, *listed]
