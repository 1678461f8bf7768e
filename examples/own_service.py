"""A service of your own: the mean brightness of each frame, on ``vision/front/brightness``.

python examples/own_service.py [tcp/127.0.0.1:7447]      Ctrl-C ends it
"""

import sys
from contextlib import suppress
from typing import ClassVar

from common.connection import Connection
from common.errors import ToldToStop
from common.keys import message_topic
from common.messages import Stamped
from common.node import Node


class Brightness(Stamped):
    """Mean grey level of one frame, 0 to 255."""

    schema_name: ClassVar[str] = "my.Brightness.v1"

    mean: float


BRIGHTNESS = message_topic("brightness", Brightness.schema_name)


def main() -> None:
    node = Node(
        "brightness",
        camera="front",
        connection=Connection(*sys.argv[1:2]),
        publishes=[BRIGHTNESS],
        messages=[Brightness],
    )
    with suppress(ToldToStop), node:  # Ctrl-C may come while there is no router yet
        for frame in node.frames("image", want="gray"):
            mean = float(frame.gray.mean())
            node.publish(BRIGHTNESS, Brightness(header=node.header(frame), mean=mean))


if __name__ == "__main__":
    main()
