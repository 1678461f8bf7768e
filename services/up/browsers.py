"""The viewers that ``zv up`` starts: their ports found free and their tokens known beforehand."""

from __future__ import annotations

from dataclasses import replace

from common.errors import ConfigurationError
from services.launch_file import Plan, PlannedNode
from services.viewer.access import token_for
from services.viewer.listening import free_port, url
from services.viewer.settings import ViewerSettings

WAY_OUT = "ZV_VIEWER_PORT=PORT, or port = PORT in the settings of its [[node]]"
"""Both go over a file that the node names as its config."""


def prepared(plan: Plan) -> Plan:
    """Return a plan in which every viewer has a port that is free, and its token.

    Raises:
        ConfigurationError: It cannot be served on; says why and the way out.
    """
    return replace(plan, nodes=tuple(_prepared(plan, node) for node in plan.nodes))


def addresses(plan: Plan) -> list[str]:
    """Return what to open in a browser."""
    return [
        url(node.settings.host, node.settings.port, node.settings.token, node.settings.address)
        for node in plan.nodes
        if isinstance(node.settings, ViewerSettings)
    ]


def _prepared(plan: Plan, node: PlannedNode) -> PlannedNode:
    settings = node.settings
    if not isinstance(settings, ViewerSettings):
        return node
    try:
        port = free_port(settings.host, settings.port, WAY_OUT)
    except ConfigurationError as error:
        raise ConfigurationError(f"{plan.place}: {node.name}: {error}") from None
    known = {"port": port, "token": token_for(settings.host, settings.token)}
    return replace(node, settings=settings.model_copy(update=known))
