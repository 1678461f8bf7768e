"""The state of the system that pages show: nodes, streams, health, parameters, log of changes."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Collection, Hashable, Iterator
from functools import lru_cache

from zenoh_vision import keys
from zenoh_vision.health.counter_change import losses
from zenoh_vision.health.fleet import MAX_NODES, Event, Fleet, ParameterGone
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.messages import (
    Diagnostics,
    Level,
    NodeDescription,
    Parameter,
    ParameterList,
)
from zenoh_vision.transport.matching import matches
from zv.viewer import events
from zv.viewer.topics import is_stream, kind_of

LINES = 200
FORGET_S = 600.0
MAX_PUBLISHED = 256
"""Keys that a node publishes, and those that it subscribes to."""

MAX_STREAMS = 4096
MAX_MISNAMED = 8
CUT_AGAIN_S = 60.0
PANELS = frozenset({"health", "parameters", "log", "matches"})
"""Kinds of texts that are shown only in panels of the page."""


class SystemState:
    """A fleet, and the messages that describe it to pages; used on the event loop.

    Messages about health and parameters are sent at once. The lists of nodes and streams are made
    from all nodes, so ``flush`` sends them once for many changes; the JSON of each node's part is
    made when the node changes.

    Args:
        namespace: First chunk of the nodes' keys.
        say: Called with the text of each message to all pages, and a name. The message replaces a
            queued one of the same name; None replaces nothing.
        wanted: Tells whether a page shows a kind of ``PANELS``; others are not made.
    """

    def __init__(
        self,
        namespace: str,
        say: Callable[[str, Hashable | None], None],
        wanted: Callable[[str], bool] = lambda _: True,
    ) -> None:
        self.namespace = namespace
        self.connected = False
        self._cut_said: dict[str, float] = {}
        self.fleet = Fleet(forget_s=FORGET_S)
        self._say = say
        self._wanted = wanted
        self._lines: deque[tuple[str, Hashable]] = deque(maxlen=LINES)
        self._lines_made = 0
        # By node: its JSON, and that of its streams by key.
        self._items: dict[str, tuple[str, dict[str, str]]] = {}
        self._sent: dict[Hashable, str] = {}
        self._published: dict[str, int | None] = {}
        self._misnamed: tuple[str, ...] = ()
        self._changed = False
        self._streams: list[str] | None = None

    # What pages get

    def overview(
        self, kinds: Collection[str] = PANELS, *, new: bool = True
    ) -> list[tuple[str, Hashable]]:
        """Return the messages that a page needs at once, each with the name that it is queued by.

        ``kinds`` are the kinds of ``PANELS`` that the page begins to show. A page that was open
        before needs only those.
        """
        lines = self._lines if "log" in kinds else ()
        router = [(self._router_text(), "router")] if new else []
        found = [*lines, *router, *self._lists(kinds, common=new)]
        for text, op in found:
            if self._sent.get(op) != text:  # so that this page also learns of a change back
                self._sent.pop(op, None)
        return found

    def details(self, kinds: Collection[str] = PANELS) -> Iterator[tuple[str, Hashable]]:
        """Yield the other messages that a new page needs, made from each node's current state."""
        for name in [node.name for node in self.fleet.nodes()]:
            node = self.fleet.node(name)
            if "health" in kinds and node is not None and node.report is not None:
                yield _health_text(node, node.report), ("health", name)
            if "parameters" in kinds and node is not None and node.alive and node.parameters:
                yield _parameters_text(node), ("parameters", name)

    @property
    def streams(self) -> list[str]:
        """The keys of the streams of the living nodes and of other publishers, sorted."""
        if self._streams is None:
            alive = (node.name for node in self.fleet.nodes() if node.alive)
            found = {key for name in alive for key in self._items[name][1]}
            found.update(key for key, gone_ns in self._published.items() if gone_ns is None)
            self._streams = sorted(found)
        return self._streams

    # Events

    def router(self, connected: bool) -> None:
        """Note that the router was connected or lost."""
        if connected != self.connected:
            self.connected = connected
            self._say(self._router_text(), "router")
            there = "there" if connected else "gone"
            self.log("INFO" if connected else "WARN", "", f"the router is {there}")

    def take(self, name: str, event: Event) -> None:
        """Note an event of a node.

        Raises:
            PayloadError: As for the methods of ``Fleet``.
        """
        before = self.fleet.node(name)
        if isinstance(event, bool):
            if self.fleet.token(name, event, time.time_ns()):
                self.log("INFO" if event else "WARN", name, f"is {'there' if event else 'gone'}")
                for key in () if event or name not in self._items else self._items[name][1]:
                    self._published.pop(key, None)  # until it is listed again
                self._node_changed(name)
        elif before is None:
            return  # it has no token
        elif isinstance(event, Diagnostics):
            self._take_report(before, event)
        elif isinstance(event, ParameterGone):
            self._remove_parameter(name, event)
        elif self.fleet.change_parameter(name, event):
            if self._wanted("parameters"):
                text = events.text("parameter", node=name, parameter=event.to_map())
                self._say(text, ("parameters", name, event.name))
            known = before.parameters.get(event.name)
            if known is None or known.value != event.value:
                was = "" if known is None else f"{_value(known)} -> "
                self.log("INFO", name, f"{event.name} {was}{_value(event)}")

    def _remove_parameter(self, name: str, gone: ParameterGone) -> None:
        removed = self.fleet.remove_parameter(name, gone)
        node = self.fleet.node(name)
        if removed and node is not None and self._wanted("parameters"):
            self._say(_parameters_text(node), ("parameters", name))

    def describe(self, description: NodeDescription) -> None:
        """Note a node's description; raises PayloadError, as ``Fleet.describe``."""
        lists = {"publishes": description.publishes, "subscribes": description.subscribes}
        kept = {name: found[:MAX_PUBLISHED] for name, found in lists.items()}
        if kept != lists:
            node = description.node[:100]
            self.say_cut(f"{node} names more than {MAX_PUBLISHED} keys; the list is cut")
        description = description.model_copy(update={"stamp_ns": None, **kept})
        before = self.fleet.node(description.node)
        if before is not None and before.answered and before.description == description:
            return
        if self.fleet.describe(description.node, description):
            self._node_changed(description.node)

    def set_parameters(self, found: ParameterList) -> None:
        """Note all parameters of a node."""
        changed = self.fleet.set_parameters(found.node, found.parameters)
        if changed and self._wanted("parameters"):
            node = self.fleet.node(found.node)
            assert node is not None
            self._say(_parameters_text(node), ("parameters", found.node))

    def set_published(self, found: Collection[str], *, complete: bool = True) -> None:
        """Record the streams that nodes or other programs publish, as the routers list them.

        A stream that is no longer listed is kept as gone; if the list is not complete, it does not
        change.
        """
        if len(found) > MAX_STREAMS:
            self.say_cut(f"there are more than {MAX_STREAMS} streams; the list is cut")
        now_ns = time.time_ns()
        published: dict[str, int | None] = dict.fromkeys(sorted(found)[:MAX_STREAMS])
        for key, gone_ns in self._published.items():
            if key not in published and len(published) < MAX_STREAMS:
                published[key] = gone_ns or (now_ns if complete else None)
        if published != self._published:
            self._published = published
            self._changed, self._streams = True, None

    def set_misnamed(self, cameras: Collection[str]) -> None:
        """Record the cameras of other programs whose names are none, so that they are not shown."""
        found = tuple(sorted(cameras)[:MAX_MISNAMED])
        if found != self._misnamed:
            self._misnamed, self._changed = found, True

    def expire(self) -> None:
        """Forget the nodes and other publishers that have been gone for long."""
        now_ns = time.time_ns()
        before_ns = now_ns - int(FORGET_S * 1e9)
        old = [key for key, ns in self._published.items() if ns is not None and ns <= before_ns]
        for key in old:
            del self._published[key]
        if self.fleet.expire(now_ns) or old:
            self._changed = True
            self._streams = None

    def flush(self) -> None:
        """Send the lists of nodes and streams to pages, if they have changed."""
        if not self._changed:
            return
        self._changed = False
        for text, op in self._lists({kind for kind in PANELS if self._wanted(kind)}):
            if self._sent.get(op) != text:
                self._sent[op] = text
                self._say(text, op)

    def log(self, level: str, node: str, text: str) -> None:
        """Keep a line of the log and send it to all pages."""
        line = events.text("log", at_ns=time.time_ns(), level=level, node=node, text=text[:500])
        self._lines_made += 1
        replaces = ("log", self._lines_made % LINES)  # limits the queue of a page
        self._lines.append((line, replaces))
        self._say(line, replaces)

    def tick(self) -> None:
        """Send pages a sign that the connection is alive."""
        self._say(events.text("tick", now_ns=time.time_ns()), "tick")

    def say_cut(self, text: str) -> None:
        """Log what is left out, at most once a minute."""
        if time.monotonic() - self._cut_said.get(text, -CUT_AGAIN_S) >= CUT_AGAIN_S:
            if len(self._cut_said) >= LINES:
                self._cut_said.clear()
            self._cut_said[text] = time.monotonic()
            self.log("WARN", "", text)

    def _take_report(self, before: NodeState, report: Diagnostics) -> None:
        # By the time of arrival: a node's own clock may be wrong.
        self.fleet.report(before.name, report, time.time_ns())
        node = self.fleet.node(before.name)
        if node is None or not node.alive:
            return
        if self._wanted("health"):
            self._say(_health_text(node, report), ("health", node.name))
        known = before.report
        was = (known.level, _without_digits(known.message)) if known else (0, "ok")
        if (report.level, _without_digits(report.message)) != was:
            self.log(Level(report.level).name, node.name, report.message)

    def _node_changed(self, name: str) -> None:
        """Update the items of a node, and mark the lists to be sent."""
        self._changed = True
        self._streams = None
        node = self.fleet.node(name)
        assert node is not None
        description = node.description
        about = {"node": name} if description is None else description.to_map()
        item = events.to_json({**about, "alive": node.alive, "since_ns": _gone_ns(node)})
        published = () if description is None else description.publishes
        streams = (key for key in published if is_stream(key, self.namespace))
        self._items[name] = item, {key: _stream_item(key, _gone_ns(node), name) for key in streams}
        if len(self._items) > 2 * MAX_NODES:  # the fleet has forgotten some of these nodes
            self._items = {each.name: self._items[each.name] for each in self.fleet.nodes()}

    # Texts

    def _router_text(self) -> str:
        return events.text("router", connected=self.connected)

    def _lists(self, kinds: Collection[str], *, common: bool = True) -> list[tuple[str, str]]:
        """Return the messages made from all nodes, each with its name.

        The lists of nodes and of streams are left out unless ``common``.
        """
        if not common and "matches" not in kinds:
            return []
        nodes = self.fleet.nodes()
        streams: dict[str, str] = {}
        # If two nodes publish a key, the later one in the list counts: put living nodes last.
        for node in sorted(nodes, key=lambda each: each.alive):
            streams |= self._items[node.name][1]
        living = {key for n in nodes if n.alive for key in self._items[n.name][1]}
        for key, gone_ns in self._published.items():
            if key not in streams or (gone_ns is None and key not in living):
                streams[key] = _stream_item(key, gone_ns)
        if len(nodes) >= MAX_NODES:
            self.say_cut(f"there are {MAX_NODES} nodes, the maximum; more are left out")
        if len(streams) > MAX_STREAMS:
            self.say_cut(f"there are more than {MAX_STREAMS} streams; the list is cut")
        shown = sorted(streams)[:MAX_STREAMS]
        lists = []
        if common:
            items = (self._items[node.name][0] for node in nodes)
            lists.append((events.list_text("nodes", items), "nodes"))
            items = (streams[key] for key in shown)
            lists.append((events.list_text("streams", items), "streams"))
            if self._misnamed or "misnamed" in self._sent:
                lists.append((events.text("misnamed", cameras=self._misnamed), "misnamed"))
        if "matches" in kinds:
            described = [node.description for node in nodes if node.description]
            found = matches((key for each in described for key in each.subscribes), shown)
            lists.append((events.text("matches", expressions=found), "matches"))
        return lists


def panel_of(name: Hashable | None) -> str | None:
    """Return which of ``PANELS`` a message belongs to, by the name that it is queued by."""
    kind = name[0] if isinstance(name, tuple) else name
    return kind if isinstance(kind, str) and kind in PANELS else None


@lru_cache(maxsize=2 * MAX_STREAMS)
def _stream_item(key: str, gone_ns: int | None, node: str = "") -> str:
    """Return a stream as JSON; ``node`` is empty for a publisher that is not a node."""
    kind = kind_of(key)
    item = {
        "key": key,
        "kind": "picture" if kind.picture else "message",
        "camera": keys.camera_of(key),
        "topic": keys.suffix_of(key),
        "type": kind.type,
        "node": node,
        "live": gone_ns is None,
        "since_ns": gone_ns,
    }
    return events.to_json(item)


def _health_text(node: NodeState, report: Diagnostics) -> str:
    fields = report.to_map()
    lost = sum(losses(report.counters).values())
    at_ns = node.reported_ns
    return events.text("health", node=node.name, diagnostics=fields, lost=lost, at_ns=at_ns)


def _parameters_text(node: NodeState) -> str:
    found = [each.to_map() for each in node.parameters.values()]
    return events.text("parameters", node=node.name, parameters=found)


def _gone_ns(node: NodeState) -> int | None:
    return None if node.alive else node.since_ns


def _value(parameter: Parameter) -> str:
    return "not set" if parameter.value is None else repr(parameter.value)


def _without_digits(message: str) -> str:
    """Return a message without its numbers, which change every second."""
    return "".join(character for character in message if not character.isdigit())
