"""What a recording says about the system at a moment: nodes, parameters, latched messages."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any, Final

from mcap.records import Channel

from zenoh_vision.errors import PayloadError
from zenoh_vision.messages import (
    CameraInfo,
    Diagnostics,
    NodeDescription,
    Parameter,
    ParameterList,
)
from zv.bag.record import Record
from zv.bag.recording import Recording
from zv.bag.writer import ORIGIN

SYSTEM_KEY: Final = re.compile(r"@[a-z0-9_]+/(node|param|schema|diagnostics)/(.+)")


@dataclass(frozen=True)
class Snapshot:
    """What was known about a system at a moment of a recording.

    Attributes:
        nodes: Descriptions by the names of the nodes.
        parameters: Values by node and name.
        health: The newest diagnostics by the names of the nodes.
        schemas: JSON Schemas, as bytes, by the names of the messages.
        calibrations: By key.
        latched: The newest sample of each stream that the recorder asked for at its start.
    """

    nodes: dict[str, NodeDescription] = field(default_factory=dict)
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    health: dict[str, Diagnostics] = field(default_factory=dict)
    schemas: dict[str, bytes] = field(default_factory=dict)
    calibrations: dict[str, CameraInfo] = field(default_factory=dict)
    latched: dict[str, Record] = field(default_factory=dict)


def snapshot(recording: Recording, at_ns: int | None = None) -> Snapshot:
    """Return what a recording says about the system at a time of arrival, by default at its end.

    Raises:
        RecordingError: The disk fails, or the file was written by a newer version.
    """
    found = Snapshot()
    for record in recording.records_of(_tells, end_ns=None if at_ns is None else at_ns + 1):
        try:
            _add(found, record)
        except PayloadError:
            continue  # another program's
    return found


def _tells(channel: Channel) -> bool:
    topic = channel.topic
    asked = channel.metadata.get(ORIGIN) == "query"
    return asked or topic.startswith("@") or topic.endswith("/camera_info")


def _add(found: Snapshot, record: Record) -> None:
    """Note what a record says about the system.

    Raises:
        PayloadError: It is no message of its key.
    """
    if record.deleted:
        return
    matched = SYSTEM_KEY.fullmatch(record.key)
    if matched is None:
        if record.key.endswith("/camera_info"):
            found.calibrations[record.key] = CameraInfo.from_bytes(record.payload)
        if record.origin == "query":
            found.latched[record.key] = record
        return
    kind, name = matched.groups()
    if kind == "node":
        found.nodes[name] = NodeDescription.from_bytes(record.payload)
    elif kind == "diagnostics":
        found.health[name] = Diagnostics.from_bytes(record.payload)
    elif kind == "schema":
        found.schemas[name] = record.payload
    elif "/" in name:
        node, _, parameter = name.partition("/")
        value = Parameter.from_bytes(record.payload).value
        found.parameters.setdefault(node, {})[parameter] = value
    else:
        listed = ParameterList.from_bytes(record.payload)
        found.parameters[name] = {each.name: each.value for each in listed.parameters}
