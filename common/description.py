"""What a node says of itself: the process that it is, and which keys it has."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterable
from importlib import metadata

from common.messages import NodeDescription

DISTRIBUTION = "zenoh-vision"


def description(
    node: str,
    service: str,
    cameras: Iterable[str],
    *,
    started_ns: int,
    publishes: Iterable[str],
    subscribes: Iterable[str],
    rate_hz: float | None,
) -> NodeDescription:
    """Return the description of a node of this process, as of now.

    Args:
        node: Its name.
        service: What kind it is.
        cameras: Those it serves.
        started_ns: When it started, ns since 1970.
        publishes: Keys.
        subscribes: Keys.
        rate_hz: Frames per second that should arrive; None if that is not known.
    """
    return NodeDescription(
        node=node,
        service=service,
        cameras=tuple(cameras),
        version=installed_version(),
        host=socket.gethostname(),
        pid=os.getpid(),
        started_ns=started_ns,
        publishes=tuple(publishes),
        subscribes=tuple(subscribes),
        stamp_ns=time.time_ns(),
        rate_hz=rate_hz,
    )


def installed_version() -> str:
    """Return the version of this distribution, ``unknown`` when run without installing it."""
    try:
        return metadata.version(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return "unknown"
