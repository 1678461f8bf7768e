"""A recording that the viewer shows: a router of its own, and a player as a process."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from zenoh_vision import keys
from zenoh_vision.errors import SourceError
from zenoh_vision.topics import topic_of
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.router import private_router
from zv.bag.private_system import Child, zv_command
from zv.bag.recording import Recording

log = logging.getLogger(__name__)


@contextmanager
def playing(file: str, connection: Connection, start_s: float) -> Iterator[Connection]:
    """Play a recording to a router that only this viewer and the player use.

    The namespace of the viewer's ``connection`` holds if it was chosen. ``start_s`` counts from the
    first sample.

    Yields:
        The connection to that router.

    Raises:
        SourceError: The file is no recording, or has no streams of cameras.
    """
    with Recording(file) as recording:
        recorded = recording.keys()
    namespaces = sorted({key.split("/")[0] for key in recorded if topic_of(key) is not None})
    if not namespaces:
        raise SourceError(f"{file}: it has no streams of cameras")
    own = connection.namespace
    recorded_as = own if own in namespaces else namespaces[0]
    namespace = recorded_as if connection.any_namespace else own
    given = ["--keys", f"{recorded_as}/**"] if len(namespaces) > 1 else []
    with private_router() as (_, endpoint):
        command = zv_command(
            "bag", "play", file, "--stay", "--timeline", "--start", f"{start_s}s", *given
        )
        with Child(command, endpoint, namespace):
            log.info("plays %s, cameras %s", file, ", ".join(_cameras(recorded)))
            yield replace(
                connection, connect=endpoint, namespace=namespace, zenoh_config=None, timeout_s=None
            )


def _cameras(recorded: list[str]) -> list[str]:
    return sorted({keys.camera_of(key) for key in recorded if topic_of(key) is not None})
