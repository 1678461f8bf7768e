"""Show a stream of pictures in a window, as the tutorial does with ``cv2.imshow``.

python examples/show.py [tcp/127.0.0.1:7447] [tracked/compressed]      q or Ctrl-C ends it

It needs an OpenCV with windows. zenoh-vision comes with opencv-python-headless, which has none and
must be removed first, since both packages write the same files:

pip uninstall --yes opencv-python-headless
pip install opencv-python
"""

import sys
from contextlib import suppress

import cv2

from zenoh_vision import Connection, Node, ToldToStop

topic = sys.argv[2] if len(sys.argv) > 2 else "image/compressed"
try:
    cv2.namedWindow(topic)
except cv2.error:
    sys.exit(
        "this OpenCV has no windows: pip uninstall --yes opencv-python-headless, "
        "then pip install opencv-python"
    )
node = Node("window", camera="front", connection=Connection(*sys.argv[1:2]))
with suppress(ToldToStop), node:
    for frame in node.frames(topic, want="bgr"):
        cv2.imshow(topic, frame.bgr)
        if cv2.waitKey(1) == ord("q"):
            break
