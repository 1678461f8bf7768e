"""imagezmq as its README shows it: publish PORT VIDEO QUALITY, subscribe PORT N."""

import sys

import cv2
import imagezmq
import numpy as np

from benchmarks.peers.programs.measuring import Ages, jpeg_of, paced_frames


def publish(port, path, quality):
    """Send JPEGs until terminated."""
    sender = imagezmq.ImageSender(connect_to=f"tcp://127.0.0.1:{port}")
    for frame, stamp_ns in paced_frames(path):
        sender.send_jpg(str(stamp_ns), jpeg_of(frame, int(quality)))


def subscribe(port, wanted):
    """Decode each frame in a loop."""
    hub = imagezmq.ImageHub(open_port=f"tcp://127.0.0.1:{port}")
    ages = Ages(int(wanted))
    running = True
    while running:
        stamp, jpeg = hub.recv_jpg()
        cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
        running = ages.note(int(stamp))
        hub.send_reply(b"OK")


if __name__ == "__main__":
    {"publish": publish, "subscribe": subscribe}[sys.argv[1]](*sys.argv[2:])
