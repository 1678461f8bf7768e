"""Zenoh and OpenCV alone: publish ENDPOINT VIDEO QUALITY, subscribe ENDPOINT N."""

import sys
import threading

import cv2
import numpy as np
import zenoh

from benchmarks.peers.programs.measuring import Ages, jpeg_of, paced_frames

KEY = "bare/image"


def session(endpoint):
    """Open a client session."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{endpoint}"]')
    config.insert_json5("transport/shared_memory/enabled", "false")
    return zenoh.open(config)


def publish(endpoint, path, quality):
    """Publish JPEGs until terminated."""
    with session(endpoint) as opened:
        publisher = opened.declare_publisher(KEY)
        for frame, stamp_ns in paced_frames(path):
            jpeg = jpeg_of(frame, int(quality))
            publisher.put(jpeg.tobytes(), attachment=stamp_ns.to_bytes(8, "big"))


def subscribe(endpoint, wanted):
    """Decode each frame in the callback, as the examples of Zenoh do."""
    ages = Ages(int(wanted))
    done = threading.Event()

    def on_sample(sample):
        jpeg = np.frombuffer(sample.payload.to_bytes(), np.uint8)
        cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
        if not ages.note(int.from_bytes(sample.attachment.to_bytes(), "big")):
            done.set()

    with session(endpoint) as opened:
        subscriber = opened.declare_subscriber(KEY, on_sample)
        done.wait()
        subscriber.undeclare()


if __name__ == "__main__":
    {"publish": publish, "subscribe": subscribe}[sys.argv[1]](*sys.argv[2:])
