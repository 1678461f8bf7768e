"""What `zv up` tells people first: what is published, and how to read it."""

from __future__ import annotations

from common import keys
from common.connection import Connection
from services.launch_file import Plan
from services.up.browsers import addresses

SHOWN = {"camera": keys.IMAGE, "tracker": keys.CENTROID, "edge": keys.EDGES}
"""What each service is there for; it may publish more."""


def how_to_subscribe(plan: Plan, connection: Connection, *, own: bool) -> list[str]:
    """Return lines that name the router, the keys, a program to run, and last the viewer.

    Args:
        plan: What was started.
        connection: Where its router is.
        own: Whether that router was started with it.
    """
    whose = "its own" if own else "the one that is there"
    lines = [f"router: {connection.connect} ({whose}); what is published, for any Zenoh program:"]
    for node in plan.nodes:
        if node.service in SHOWN:
            topic = SHOWN[node.service]
            camera = node.name.removeprefix(f"{node.service}_")
            lines.append(f"  {topic.key(connection.namespace, camera):<36} {topic.encoding}")
    lines.append(f"for example: python examples/subscribe.py {connection.connect}")
    return [*lines, *(f"viewer: {address}" for address in addresses(plan))]
