"""A service of your own: the mean brightness of each frame, on ``vision/front/brightness``.

python examples/own_service.py [--camera front] [--connect tcp/127.0.0.1:7447] [--help]

Ctrl-C ends it. ``zv param set brightness_front gain=2`` changes its parameter while it runs.
"""

from typing import Annotated, ClassVar

from pydantic import Field

from zenoh_vision import (
    Connection,
    Live,
    Node,
    ServiceSettings,
    Stamped,
    message_topic,
    run_service,
)


class BrightnessSettings(ServiceSettings):
    """The options: flags, environment variables, and keys of a TOML file."""

    env_prefix: ClassVar[str] = "ZV_BRIGHTNESS_"

    gain: Annotated[float, Field(ge=0, le=10, description="factor of the mean"), Live()] = 1.0


class Brightness(Stamped):
    """Mean grey level of one frame, 0 to 255, times the gain."""

    schema_name: ClassVar[str] = "my.Brightness.v1"

    mean: float


BRIGHTNESS = message_topic("brightness", Brightness)


def run(settings: BrightnessSettings, connection: Connection) -> None:
    """Publish the mean brightness of each frame."""
    with Node(
        "brightness",
        camera=settings.camera,
        connection=connection,
        publishes=[BRIGHTNESS],
        parameters=settings,
    ) as node:
        for frame in node.frames("image/compressed", want="gray"):
            mean = frame.revision.settings.gain * float(frame.gray.mean())
            node.publish(BRIGHTNESS, Brightness(header=node.header(frame), mean=mean))


if __name__ == "__main__":
    run_service(run, BrightnessSettings)
