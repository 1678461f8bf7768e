"""A service of your own: the mean brightness of each frame, on ``vision/front/brightness``.

python examples/own_service.py [tcp/127.0.0.1:7447]      Ctrl-C ends it
"""

import sys
from contextlib import suppress
from typing import ClassVar

from zenoh_vision import Connection, Node, Stamped, ToldToStop, message_topic


class Brightness(Stamped):
    """Mean grey level of one frame, 0 to 255."""

    schema_name: ClassVar[str] = "my.Brightness.v1"

    mean: float


BRIGHTNESS = message_topic("brightness", Brightness)


def main() -> None:
    node = Node(
        "brightness",
        camera="front",
        connection=Connection(*sys.argv[1:2]),
        publishes=[BRIGHTNESS],
    )
    with suppress(ToldToStop), node:  # Ctrl-C may come before there is a router
        for frame in node.frames("image/compressed", want="gray"):
            mean = float(frame.gray.mean())
            node.publish(BRIGHTNESS, Brightness(header=node.header(frame), mean=mean))


if __name__ == "__main__":
    main()
