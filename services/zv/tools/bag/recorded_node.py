"""What a recording says about a node: its name, its service, its settings and their changes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, Final

from zenoh_vision import keys
from zenoh_vision.errors import ExpectationNotMet, PayloadError
from zenoh_vision.messages import Diagnostics, NodeDescription, Parameter, ParameterList
from zenoh_vision.topics import is_frame_key
from zv.bag.record import Record
from zv.bag.recording import Recording

NODE_KEY: Final = re.compile(r"@[a-z0-9_]+/node/[a-z0-9_]+")
LOOKED_AT: Final = 20_000
"""Most records in which a node is searched that the recording does not describe."""

REPORTS: Final = 30
"""Most reports of a node's health that are read for its routes: every part of a file has some."""


@dataclass(slots=True)
class RecordedNode:
    """A node in a recording.

    Attributes:
        cameras: Those whose frames it takes.
        described: Whether the recorder got its description.
        starts_ns: When it was started, and started again, ns since 1970; empty if unknown.
        subscribes: Key expressions.
        changes: Values of parameters that were valid from a revision on.
        routes: On which its frames came.
    """

    name: str
    service: str
    namespace: str
    cameras: tuple[str, ...]
    described: bool = False
    starts_ns: tuple[int, ...] = ()
    subscribes: tuple[str, ...] = ()
    changes: dict[int, dict[str, Any]] = field(default_factory=dict)
    routes: set[str] = field(default_factory=set)

    def settings(self, revision: int) -> dict[str, Any]:
        """Return the values of the parameters at a revision; those that are not set are None."""
        found: dict[str, Any] = {}
        for number in sorted(self.changes):
            # What the recorder asked for says how it was then, which may be later.
            if number <= revision or not found:
                found |= self.changes[number]
        return found


def recorded_node(recording: Recording, wanted: str, *, may_be_new: bool = False) -> RecordedNode:
    """Return the node of a name, or the only one of a service.

    With ``may_be_new``, without such a node, it is one for the cameras of the recording.

    Raises:
        ExpectationNotMet: The recording has none, or several.
    """
    described = _described(recording)
    found = {name: about for name, about in described.items() if _is(name, wanted, about)}
    if not found:
        found = {name: about for name, about in _senders(recording).items() if _is(name, wanted)}
    if len(found) > 1 and wanted not in found:
        raise ExpectationNotMet(
            f"{recording.path} has several of {wanted}: {', '.join(sorted(found))}; name one"
        )
    if not found and may_be_new:
        return _new(recording, wanted)
    if not found:
        known = ", ".join(sorted(described | _senders(recording))) or "none"
        raise ExpectationNotMet(f"{recording.path} has nothing of {wanted}; its nodes: {known}")
    node = found[wanted] if wanted in found else next(iter(found.values()))
    for record in recording.records(keys=(f"@{node.namespace}/param/{node.name}/**",)):
        for each in _parameters(record):
            node.changes.setdefault(each.revision, {})[each.name] = each.value
    reports = recording.records(keys=(keys.diagnostics_key(node.namespace, node.name),))
    for record in islice(reports, REPORTS):
        with suppress(PayloadError):
            node.routes |= set((Diagnostics.from_bytes(record.payload).routes or {}).values())
    return node


def _new(recording: Recording, wanted: str) -> RecordedNode:
    """Return a node for a camera of a recording: ``tracker_front``, or ``tracker`` of the only one.

    Raises:
        ExpectationNotMet: There is no such camera, or there are several.
    """
    streams = sorted(filter(is_frame_key, recording.keys()))
    cameras = {keys.camera_of(key): key.split("/")[0] for key in streams}
    for camera, namespace in cameras.items():
        service = wanted.removesuffix(f"_{camera}")
        if service != wanted or len(cameras) == 1:
            return RecordedNode(f"{service}_{camera}", service, namespace, (camera,))
    raise ExpectationNotMet(
        f"{recording.path} has the cameras {', '.join(cameras) or 'none'}; name the node of one: "
        f"{wanted}_CAMERA"
    )


def _is(name: str, wanted: str, about: RecordedNode | None = None) -> bool:
    return name == wanted or (
        about.service == wanted if about is not None else name.startswith(f"{wanted}_")
    )


def _described(recording: Recording) -> dict[str, RecordedNode]:
    found: dict[str, RecordedNode] = {}
    recorded = recording.keys()
    described = list(filter(NODE_KEY.fullmatch, recorded))
    for record in recording.records(keys=described) if described else ():
        try:
            about = NodeDescription.from_bytes(record.payload)
        except PayloadError:
            continue
        earlier = found[about.node].starts_ns if about.node in found else ()
        found[about.node] = RecordedNode(
            about.node,
            about.service,
            record.key.split("/")[0].removeprefix("@"),
            tuple(about.cameras),
            described=True,
            starts_ns=tuple(sorted({*earlier, about.started_ns})),
            subscribes=tuple(about.subscribes),
        )
    return found


def _senders(recording: Recording) -> dict[str, RecordedNode]:
    """Return the senders that the headers name, of nodes that the recorder could not ask."""
    found: dict[str, RecordedNode] = {}
    for record in islice(recording.records(keys=("*/*/**",)), LOOKED_AT):
        name, camera = record.header.get("node"), record.header.get("camera")
        if isinstance(name, str) and name and isinstance(camera, str):
            service = name.removesuffix(f"_{camera}")
            namespace = record.key.split("/")[0]
            found.setdefault(name, RecordedNode(name, service, namespace, (camera,)))
    return found


def _parameters(record: Record) -> Iterator[Parameter]:
    try:
        if keys.schema_name_of(record.encoding) == ParameterList.schema_name:
            yield from ParameterList.from_bytes(record.payload).parameters
        elif not record.deleted:
            yield Parameter.from_bytes(record.payload)
    except PayloadError:
        return
