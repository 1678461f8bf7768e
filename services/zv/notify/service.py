"""The loop of ``zv notify``."""

from __future__ import annotations

import time

from zenoh_vision import Connection, Level, Node
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.image.exif import as_stored
from zenoh_vision.keys import JPEG, PNG
from zenoh_vision.messages import TrackEvent
from zenoh_vision.topics import COMPRESSED, EVENTS
from zenoh_vision.transport.query import newest
from zv.notify.delivery import Delivery, Receiver
from zv.notify.mqtt import Mqtt
from zv.notify.notice import Choice, Notice, fields_of
from zv.notify.settings import NotifySettings, kinds_of
from zv.notify.webhook import Webhook

PICTURES = ("tracked/compressed", COMPRESSED.name)
"""Topics of the picture of an event, the one with boxes first."""

MOST_PICTURE_BYTES = 4 << 20
TAKE_S = 0.2


def run(settings: NotifySettings, connection: Connection) -> None:
    """Send the events of trackers to their receivers until told to stop.

    Raises:
        ConfigurationError: There is no receiver, or the broker's URL is wrong.
    """
    parameters = ParameterStore(settings)
    receivers = receivers_of(settings)
    with (
        Node(
            "notify",
            name=settings.node_name,
            camera=settings.cameras,
            connection=connection,
            parameters=parameters,
        ) as node,
        Delivery(
            receivers,
            lambda: parameters.newest.settings.keep_trying,
            lambda: node.counters.note("undelivered"),
        ) as delivery,
    ):
        events = node.messages(EVENTS, camera="*")
        choice = Choice()
        while not node.stopping:
            node.health.loop_alive()
            fault = delivery.fault
            node.report("delivery", Level.WARN if fault else Level.OK, fault)
            event = events.take(TAKE_S)
            if event is None:
                continue
            active = parameters.activate().settings
            if isinstance(event, TrackEvent) and _is_of(event, active) and choice.is_new(event):
                fields = fields_of(event, time.time_ns())
                kinds = kinds_of(active.events)
                if choice.allow(event, kinds, active.cooldown, time.monotonic()):
                    picture = newest_picture(node, event.header.camera) if active.picture else None
                    delivery.put(Notice(fields, *picture) if picture else Notice(fields))
                elif event.inside is not None:
                    delivery.put(Notice(fields, announced=False))
            events.done(event)


def receivers_of(settings: NotifySettings) -> list[Receiver]:
    """Return where the settings say that events go.

    Raises:
        ConfigurationError: Nowhere, or the broker's URL is wrong.
    """
    found: list[Receiver] = []
    if settings.webhook is not None:
        found.append(Webhook(settings.webhook))
    if settings.mqtt is not None:
        name = settings.node_name
        found.append(Mqtt(settings.mqtt, settings.prefix, settings.discovery, name))
    if not found:
        raise ConfigurationError(
            "nobody receives the events; allowed: --webhook URL, --mqtt mqtt://HOST, or both"
        )
    return found


def newest_picture(node: Node, camera: str) -> tuple[bytes, str] | None:
    """Return the newest picture of a camera and its type; with boxes if a tracker answers."""
    keys = [f"{node.connection.namespace}/{camera}/{topic}" for topic in PICTURES]
    for sample in newest(node.link.session, keys, MOST_PICTURE_BYTES, lambda: node.stopping):
        mime = str(sample.encoding).partition(";")[0]
        if mime in (JPEG, PNG):
            payload = sample.payload.to_bytes()
            return (as_stored(payload) if mime == JPEG else payload), mime
    return None


def _is_of(event: TrackEvent, settings: NotifySettings) -> bool:
    return not settings.cameras or event.header.camera in settings.cameras
