"""Where the router is. Imports nothing: every command's help needs it, without loading Zenoh."""

from __future__ import annotations

from dataclasses import dataclass

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"


@dataclass(frozen=True, slots=True)
class Connection:
    """Where a node or tool finds its router.

    Attributes:
        connect: Zenoh endpoint, ``tcp/HOST:PORT``.
        namespace: First chunk of every key expression.
        zenoh_config: JSON5 file that the session starts from, for TLS and the like.
        timeout_s: How long to wait for a router; None waits forever.
    """

    connect: str = DEFAULT_ENDPOINT
    namespace: str = "vision"
    zenoh_config: str | None = None
    timeout_s: float | None = None
