"""What pages know of the system: nodes, streams, health, parameters, and what happened."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field

from common.messages import Diagnostics, NodeDescription, Parameter
from services.viewer import wire
from services.viewer.topics import camera_of, is_stream, kind_of, suffix_of

LEVELS = ("OK", "WARN", "ERROR", "STALE")
LINES = 200
FORGET_S = 600.0
MAX_NODES = 500


@dataclass(slots=True)
class Known:
    """One node.

    Attributes:
        name: Of the node.
        alive: Whether its token is there.
        since_ns: Since when it is so.
        description: What it says of itself; kept when it is gone.
        health: Its newest report.
        health_ns: When that came, by this machine's clock: a node's own may be wrong.
        parameters: By name.
    """

    name: str
    alive: bool
    since_ns: int
    description: NodeDescription | None = None
    health: Diagnostics | None = None
    health_ns: int = 0
    parameters: dict[str, Parameter] = field(default_factory=dict)


class System:
    """The newest of everything; on the browsers' loop.

    Args:
        namespace: Of the nodes.
        say: Called with each message to all pages: its text, and what it replaces of those that
            a page has not got yet; None replaces nothing.
    """

    def __init__(self, namespace: str, say: Callable[[str, Hashable | None], None]) -> None:
        self.namespace = namespace
        self.connected = False
        self._say = say
        self._nodes: dict[str, Known] = {}
        self._lines: deque[str] = deque(maxlen=LINES)
        self._texts: dict[str, str] = {}

    # What pages get

    def everything(self) -> list[str]:
        """Return the messages that a new page needs."""
        found = [*self._lines, self._router_text()]
        found += [self._nodes_text(), self._streams_text()]
        for node in self._nodes.values():
            if node.health is not None:
                found.append(self._health_text(node.name, node.health, node.health_ns))
            if node.alive and node.parameters:
                found.append(self._parameters_text(node))
        return found

    @property
    def streams(self) -> list[str]:
        """The keys of the streams that there are."""
        return sorted(
            {
                key
                for node in self._nodes.values()
                if node.alive and node.description is not None
                for key in node.description.publishes
                if is_stream(key, self.namespace)
            }
        )

    # What happens

    def router(self, connected: bool) -> None:
        """Take note whether a router is there."""
        if connected != self.connected:
            self.connected = connected
            self._say(self._router_text(), "router")
            self.log("INFO" if connected else "WARN", "", f"the router is {_there(connected)}")

    def token(self, name: str, alive: bool) -> bool:
        """Take note that a node came or went; return whether that is news."""
        node = self._nodes.get(name)
        if node is not None and node.alive == alive:
            return False
        if node is None:
            if not alive or len(self._nodes) >= MAX_NODES:
                return False
            node = self._nodes[name] = Known(name, alive, time.time_ns())
        node.alive, node.since_ns = alive, time.time_ns()
        if alive:
            node.health = None
        self.log("INFO" if alive else "WARN", name, "is there" if alive else "is gone")
        self._nodes_changed()
        return True

    def describe(self, description: NodeDescription) -> None:
        """Take a node's word on itself."""
        node = self._nodes.get(description.node)
        if node is not None and node.alive:
            node.description = description
            self._nodes_changed()

    def undescribed(self) -> list[str]:
        """Return the living nodes of which something is not known."""
        return [node.name for node in self._nodes.values() if node.alive and not node.description]

    def health(self, report: Diagnostics) -> None:
        """Take a node's report."""
        node = self._nodes.get(report.node)
        if node is None or not node.alive:
            return
        before, node.health, node.health_ns = node.health, report, time.time_ns()
        text = self._health_text(node.name, report, node.health_ns)
        self._say(text, ("health", node.name))
        was = (before.level, _words(before.message)) if before else (0, _words("ok"))
        if (report.level, _words(report.message)) != was:
            self.log(LEVELS[report.level], node.name, report.message)

    def parameters(self, name: str, parameters: list[Parameter]) -> None:
        """Take all parameters of a node."""
        node = self._nodes.get(name)
        found = {each.name: each for each in parameters}
        if node is not None and node.parameters != found:
            node.parameters = found
            self._say(self._parameters_text(node), ("parameters", name))

    def parameter(self, changed: Parameter) -> None:
        """Take a change of one parameter."""
        node = self._nodes.get(changed.node)
        if node is None:
            return
        before = node.parameters.get(changed.name)
        if before is not None and before.revision > changed.revision:
            return
        node.parameters[changed.name] = changed
        text = wire.text("parameter", node=changed.node, parameter=changed.to_map())
        self._say(text, ("parameter", changed.node, changed.name))
        if before is None or before.value != changed.value:
            was = "" if before is None else f"{_value(before)} -> "
            self.log("INFO", changed.node, f"{changed.name} {was}{_value(changed)}")

    def knows(self, name: str) -> bool:
        """Tell whether there is a node of this name."""
        node = self._nodes.get(name)
        return node is not None and node.alive

    def log(self, level: str, node: str, text: str) -> None:
        """Keep a line and show it to all pages."""
        line = wire.text("log", at_ns=time.time_ns(), level=level, node=node, text=text[:500])
        self._lines.append(line)
        self._say(line, None)

    def forget(self) -> None:
        """Forget the nodes that have been gone for long."""
        before_ns = time.time_ns() - int(FORGET_S * 1e9)
        gone = [n.name for n in self._nodes.values() if not n.alive and n.since_ns < before_ns]
        for name in gone:
            del self._nodes[name]
        if gone:
            self._nodes_changed()

    # Texts

    def _nodes_changed(self) -> None:
        for op, text in (("nodes", self._nodes_text()), ("streams", self._streams_text())):
            if self._texts.get(op) != text:
                self._texts[op] = text
                self._say(text, op)

    def tick(self) -> None:
        """Let the pages know that the connection is there."""
        self._say(wire.text("tick", now_ns=wire.now_ns()), "tick")

    def _router_text(self) -> str:
        return wire.text("router", connected=self.connected)

    def _health_text(self, name: str, report: Diagnostics, at_ns: int) -> str:
        return wire.text("health", node=name, diagnostics=report.to_map(), at_ns=at_ns)

    def _parameters_text(self, node: Known) -> str:
        found = [each.to_map() for each in node.parameters.values()]
        return wire.text("parameters", node=node.name, parameters=found)

    def _nodes_text(self) -> str:
        found = []
        for node in sorted(self._nodes.values(), key=lambda each: each.name):
            about = node.description.to_map() if node.description else {"node": node.name}
            about.pop("stamp_ns", None)
            since_ns = None if node.alive else node.since_ns
            found.append({**about, "alive": node.alive, "since_ns": since_ns})
        return wire.text("nodes", nodes=found)

    def _streams_text(self) -> str:
        found: dict[str, dict[str, object]] = {}
        for node in sorted(self._nodes.values(), key=lambda each: each.alive):
            for key in node.description.publishes if node.description else ():
                if not is_stream(key, self.namespace):
                    continue
                kind = kind_of(key)
                found[key] = {  # a node that lives goes over one that is gone
                    "key": key,
                    "kind": "picture" if kind.picture else "message",
                    "camera": camera_of(key),
                    "topic": suffix_of(key),
                    "type": kind.type,
                    "node": node.name,
                    "live": node.alive,
                    "since_ns": None if node.alive else node.since_ns,
                }
        return wire.text("streams", streams=[found[key] for key in sorted(found)])


def _there(connected: bool) -> str:
    return "there" if connected else "gone"


def _value(parameter: Parameter) -> str:
    return "not set" if parameter.value is None else repr(parameter.value)


def _words(message: str) -> str:
    """Return a message without its numbers, which change every second."""
    return "".join(character for character in message if not character.isdigit())
