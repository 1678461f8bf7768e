"""A picture on its way from the thread that reads to the one that publishes."""

from __future__ import annotations

from dataclasses import dataclass

from common.live import Revision
from services.camera.settings import CameraSettings
from services.camera.sources.base import Picture


@dataclass(frozen=True, slots=True)
class Captured:
    """A picture with its identity: born here, nothing changes it afterwards.

    Attributes:
        revision: The settings that it is made with, from reading to publishing.
    """

    picture: Picture
    epoch: int
    seq: int
    stamp_ns: int
    revision: Revision[CameraSettings]
