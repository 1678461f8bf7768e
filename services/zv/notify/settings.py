"""The options of ``zv notify``; flags, configuration files and live parameters derive from them."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import AfterValidator, Field

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.parameters import Live
from zenoh_vision.config.settings import CameraNames, Secret, ServiceSettings, cameras_of

KINDS = (
    *("started", "confirmed", "lost", "ended"),
    *("zone_entered", "zone_left", "zone_dwell", "line_crossed"),
)
USUAL_KINDS = "zone_entered,zone_left,zone_dwell,line_crossed"


def kinds_of(text: str) -> frozenset[str]:
    """Return the kinds of events in a text, separated by commas.

    Raises:
        ValueError: There is no such kind.
    """
    found = frozenset(filter(None, text.split(",")))
    if unknown := found - set(KINDS):
        raise ValueError(f"{sorted(unknown)[0]!r} is none of {', '.join(KINDS)}")
    return found


def _known_kinds(text: str) -> str:
    kinds_of(text)
    return text


class NotifySettings(ServiceSettings):
    """Options of ``zv notify``."""

    env_prefix: ClassVar[str] = "ZV_NOTIFY_"

    camera: Annotated[
        CameraNames, Field(description="cameras whose events are sent: front,left, or * for all")
    ] = "*"
    webhook: Annotated[
        str | None,
        Field(
            pattern=r"^https?://\S+$",
            max_length=2000,
            description="URL to which each event is posted, with its picture",
        ),
        Form("http://HOST/PATH or https://HOST/PATH"),
        Secret(),
    ] = None
    mqtt: Annotated[
        str | None,
        Field(
            pattern=r"^mqtts?://\S+$",
            max_length=500,
            description="MQTT broker to which events and pictures are published",
        ),
        Form("mqtt://USER:PASSWORD@HOST:PORT, or mqtts://"),
        Secret(),
    ] = None
    prefix: Annotated[
        str,
        Field(
            pattern=r"^[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)*$",
            max_length=100,
            description="first part of the MQTT topics",
        ),
        Form("letters, digits, _ and -, with / between"),
    ] = "zenoh_vision"
    discovery: Annotated[
        str,
        Field(
            pattern=r"^[A-Za-z0-9_-]*$",
            max_length=100,
            description="prefix of Home Assistant's MQTT discovery; empty: none",
        ),
        Form("letters, digits, _ and -, or empty"),
    ] = "homeassistant"
    events: Annotated[
        str,
        AfterValidator(_known_kinds),
        Field(max_length=200, description="kinds of events that are sent, separated by commas"),
        Form("kinds separated by commas: " + ", ".join(KINDS)),
        Live(),
    ] = USUAL_KINDS
    cooldown: Annotated[
        float,
        Field(
            ge=0,
            le=86_400,
            description="time after an event in which others of the same kind, camera and zone are "
            "left out",
        ),
        Live("s"),
        SECONDS,
    ] = 0.0
    picture: Annotated[bool, Field(description="send the picture too"), Live()] = True
    keep_trying: Annotated[
        float,
        Field(
            ge=0,
            le=86_400,
            description="how long an event is sent again if its receiver does not take it",
        ),
        Live("s"),
        SECONDS,
    ] = 300.0

    @property
    def cameras(self) -> tuple[str, ...]:
        """The names of the cameras; empty for all cameras."""
        return cameras_of(self.camera)

    @property
    def node_name(self) -> str:
        """The name of the node."""
        return f"notify_{self.cameras[0]}" if len(self.cameras) == 1 else "notify"
