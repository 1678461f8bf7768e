"""Publishes notices to an MQTT broker, and describes them to Home Assistant.

Topics below the prefix: ``status`` is ``online`` or ``offline``, ``{camera}/events`` the event as
JSON, ``{camera}/picture`` the newest picture, ``{camera}/zone/{zone}`` ``ON`` while an object is in
the zone. Pictures and zones are retained, so that a receiver that starts later has them.
"""

from __future__ import annotations

import json
import re
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any, Final
from urllib.parse import unquote, urlsplit

import aiomqtt

from zenoh_vision.errors import ConfigurationError
from zv.notify.delivery import NotTaken
from zv.notify.notice import Notice

PORT, TLS_PORT = 1883, 8883
ANSWER_S: Final = 10.0
FAILURES: Final = (aiomqtt.MqttError, OSError)
"""What a broker that is lost raises; a time-out is an OSError."""

MOST_DESCRIBED: Final = 500
"""Entities of cameras and zones that are described; zones have any names."""


class Mqtt:
    """One broker, which is connected again after each loss.

    Args:
        url: ``mqtt://USER:PASSWORD@HOST:PORT``, or ``mqtts://``.
        prefix: First part of the topics.
        discovery: Home Assistant's prefix; empty for no description.
        node: Name of this node, which identifies its entities.

    Raises:
        ConfigurationError: The URL names no host or no port that there is.
    """

    name = "mqtt"
    shows_state = True

    def __init__(self, url: str, prefix: str, discovery: str, node: str) -> None:
        try:
            parts = urlsplit(url)
            host, port = parts.hostname, parts.port
        except ValueError:
            host = None
        if not host or port == 0:
            raise ConfigurationError("mqtt names no host or no port; allowed: mqtt://HOST:PORT")
        self._host = host
        is_tls = parts.scheme == "mqtts"
        self._port = port or (TLS_PORT if is_tls else PORT)
        self._user = unquote(parts.username) if parts.username else None
        self._password = unquote(parts.password) if parts.password else None
        self._tls = ssl.create_default_context() if is_tls else None
        self._prefix, self._discovery, self._node = prefix, discovery, node
        self._client: aiomqtt.Client | None = None
        self._described: set[str] = set()

    async def keep(self) -> None:
        """Connect, or find out whether the connection is lost, and be online."""
        async with self._answering():
            if self._client is None:
                await self._connected()
            else:
                await self._client.publish(self._status, "online", qos=1, retain=True)

    async def send(self, notice: Notice) -> None:
        """Publish a notice; each part arrives before this returns (QoS 1)."""
        async with self._answering():
            client = await self._connected()
            await self._describe(client, notice)
            base = f"{self._prefix}/{notice.camera}"
            if notice.picture and notice.announced:
                await client.publish(f"{base}/picture", notice.picture, qos=1, retain=True)
            zone, inside = notice.fields.get("zone"), notice.fields.get("inside")
            if zone and inside is not None:
                state = "ON" if inside else "OFF"
                await client.publish(f"{base}/zone/{_level(zone)}", state, qos=1, retain=True)
            if notice.announced:
                await client.publish(f"{base}/events", json.dumps(notice.fields), qos=1)

    async def close(self) -> None:
        """Say that it is offline, and disconnect."""
        if self._client is not None:
            with suppress(*FAILURES):
                await self._client.publish(self._status, "offline", qos=1, retain=True)
                await self._disconnect()

    @asynccontextmanager
    async def _answering(self) -> AsyncIterator[None]:
        """Raise NotTaken, and disconnect, if the broker cannot be reached or does not answer."""
        try:
            yield
        except FAILURES as error:
            await self._disconnect()
            raise NotTaken(str(error) or type(error).__name__) from None

    @property
    def _status(self) -> str:
        return f"{self._prefix}/status"

    async def _connected(self) -> aiomqtt.Client:
        if self._client is None:
            client = aiomqtt.Client(
                self._host,
                self._port,
                username=self._user,
                password=self._password,
                tls_context=self._tls,
                timeout=ANSWER_S,
                will=aiomqtt.Will(self._status, "offline", qos=1, retain=True),
            )
            await client.__aenter__()
            self._client = client
            self._described.clear()
            await client.publish(self._status, "online", qos=1, retain=True)
        return self._client

    async def _disconnect(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            with suppress(*FAILURES):
                await client.__aexit__(None, None, None)

    async def _describe(self, client: aiomqtt.Client, notice: Notice) -> None:
        """Describe the camera and the zone of a notice, once for each connection."""
        if not self._discovery:
            return
        zone = notice.fields.get("zone") if "inside" in notice.fields else None
        for component, name, about in self._entities(notice.camera, zone):
            topic = f"{self._discovery}/{component}/{self._node}/{name}/config"
            if topic not in self._described and len(self._described) < MOST_DESCRIBED:
                await client.publish(topic, json.dumps(about), qos=1, retain=True)
                self._described.add(topic)

    def _entities(self, camera: str, zone: str | None) -> list[tuple[str, str, dict[str, Any]]]:
        """Return component, name and description of each entity of a camera, and of a zone."""
        base = f"{self._prefix}/{camera}"
        common = {
            "availability_topic": self._status,
            "device": {
                "identifiers": [f"{self._node}_{camera}"],
                "name": camera,
                "manufacturer": "zenoh-vision",
            },
        }

        def entity(component: str, name: str, shown: str, **about: str) -> tuple[str, str, Any]:
            ids = {"unique_id": f"{self._node}_{name}", "name": shown}
            return component, name, {**common, **ids, **about}

        found = [
            entity("camera", f"{camera}_picture", "Last event", topic=f"{base}/picture"),
            entity(
                "sensor",
                f"{camera}_event",
                "Event",
                state_topic=f"{base}/events",
                value_template="{{ value_json.event }}",
                json_attributes_topic=f"{base}/events",
            ),
        ]
        if zone is not None:
            found.append(
                entity(
                    "binary_sensor",
                    f"{camera}_zone_{_level(zone)}",
                    zone,
                    state_topic=f"{base}/zone/{_level(zone)}",
                    device_class="occupancy",
                )
            )
        return found


def _level(name: str) -> str:
    """Return a name as one level of a topic, without its separators and wildcards."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", name)[:64]
