"""The relay's options; flags, configuration files and live parameters derive from them."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.consumer_options import MaxAge
from zenoh_vision.config.parameters import Live
from zenoh_vision.config.region import REGION_FORM, REGION_PATTERN, box_of
from zenoh_vision.config.settings import NAME_FORM, Argument, ServiceSettings
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.keys import is_name
from zenoh_vision.messages import Box
from zenoh_vision.topics import COMPRESSED, TOPICS

LEAST_SCALE = 0.125
PICTURES = tuple(name for name, topic in TOPICS.items() if topic.message is None)
RELAYED = "relayed/compressed"


class RelaySettings(ServiceSettings):
    """Options of ``zv relay``."""

    env_prefix: ClassVar[str] = "ZV_RELAY_"

    key: Annotated[
        str,
        Argument("KEY"),
        Field(
            pattern=r"^[A-Za-z0-9_./~-]*$",
            max_length=200,
            description="stream of pictures to relay: a key such as vision/front/tracked/compressed"
            ", or a topic of the camera, such as tracked/compressed; not set: image/compressed",
        ),
        Form("letters, digits and _ . / ~ -"),
    ] = ""
    to: Annotated[
        str,
        Field(
            pattern=r"^[a-z0-9_]*$",
            max_length=64,
            description="name of a camera as which the pictures are published, with its "
            "camera_info, so that it can be tracked; empty: they stay pictures of their camera, on "
            "relayed/compressed",
        ),
        NAME_FORM,
    ] = ""
    rate: Annotated[
        float | None,
        Field(
            ge=0.001,
            le=1000,
            description="most pictures per second, chosen by their stamps; not set: all",
        ),
        Live("Hz"),
    ] = None
    scale: Annotated[
        float,
        Field(
            ge=LEAST_SCALE,
            le=1,
            description="factor of width and height; coordinates stay those of the whole picture",
        ),
        Live(),
    ] = 1.0
    quality: Annotated[
        int | None,
        Field(
            ge=1,
            le=100,
            description="JPEG quality; not set: pictures that nothing else changes are passed on "
            "as they are, others get 80",
        ),
        Live(),
    ] = None
    region: Annotated[
        str,
        Field(
            max_length=40,
            pattern=REGION_PATTERN,
            description="part of the picture, after rectify: X,Y,WIDTH,HEIGHT in pixels; empty: "
            "all of it",
        ),
        REGION_FORM,
        Live(),
    ] = ""
    rectify: Annotated[
        bool,
        Field(
            description="take the distortion of the lens out, by the camera's camera_info; without "
            "one nothing is relayed"
        ),
        Live(),
    ] = False
    max_age: MaxAge = 1.0

    @property
    def box(self) -> Box | None:
        """The region as x, y, width and height; None for the whole picture."""
        return box_of(self.region)

    @property
    def node_name(self) -> str:
        """The name of the node: that of the camera as which it publishes, if it is another."""
        camera, _ = self.stream()
        return f"relay_{self.to or camera}"

    def stream(self, namespace: str = "") -> tuple[str, str]:
        """Return camera and topic of the stream to relay.

        Raises:
            ConfigurationError: The key is not one of this namespace, or the stream is what the
                relay itself would publish.
        """
        camera, topic = self._named_stream(namespace)
        if self.to == camera:
            raise ConfigurationError(
                f"to = {self.to!r} is not allowed, since it is the camera of the pictures; "
                "allowed: the name of another camera, or leave it out"
            )
        if not self.to and topic == RELAYED:
            raise ConfigurationError(
                f"KEY = {self.key!r} is not allowed, since the relay publishes on it; allowed: "
                "another stream of pictures, or --to with the name of another camera"
            )
        if topic in TOPICS and topic not in PICTURES:
            raise ConfigurationError(
                f"KEY = {self.key!r} is not allowed: {topic} is no stream of pictures; allowed: "
                + ", ".join(PICTURES)
            )
        return camera, topic

    def _named_stream(self, namespace: str) -> tuple[str, str]:
        if not self.key or self.key in TOPICS:
            return self.camera, self.key or COMPRESSED.name
        chunks = self.key.strip("/").split("/")
        has_namespace = (
            chunks[0] == namespace
            if "/".join(chunks[1:]) in TOPICS
            else len(chunks) > 2  # also of a topic that another program made up
        )
        if has_namespace and namespace and chunks[0] != namespace:
            raise ConfigurationError(
                f"KEY = {self.key!r} is not allowed: it is not of the namespace {namespace}"
            )
        chunks = chunks[has_namespace:]
        if len(chunks) < 2 or not is_name(chunks[0]):
            raise ConfigurationError(
                f"KEY = {self.key!r} is not allowed; allowed: a stream of pictures such as "
                "vision/front/image/compressed, or one of the topics " + ", ".join(PICTURES)
            )
        return chunks[0], "/".join(chunks[1:])
