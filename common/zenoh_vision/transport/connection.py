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
        zenoh_config: JSON5 file that the session starts from.
        credentials: File of ``zv security`` with certificate, key and rights. The endpoint in it
            is used instead of the default one.
        timeout_s: How long to wait for a router; None waits forever.
        any_namespace: Nobody chose the namespace, so a program may take another that it finds.
    """

    connect: str = DEFAULT_ENDPOINT
    namespace: str = "vision"
    zenoh_config: str | None = None
    credentials: str | None = None
    timeout_s: float | None = None
    any_namespace: bool = False
