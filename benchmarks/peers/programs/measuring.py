"""What all publishers and subscribers of the comparison share; needs nothing but OpenCV."""

import json
import sys
import time

import cv2

RATE_HZ = 30.0
WARM_UP = 30


def opencv_frames(path):
    """Yield the frames of a video once, as arrays."""
    video = cv2.VideoCapture(path)
    while True:
        read, frame = video.read()
        if not read:
            break
        yield frame


def paced_frames(path, frames=opencv_frames):
    """Yield a frame of a video and the time of its capture, ns since 1970, at 30 Hz for ever.

    As in a camera's driver, the frame is there at its time: it is decoded before.
    """
    due_s = time.monotonic()
    while True:
        for frame in frames(path):
            due_s = max(due_s + 1 / RATE_HZ, time.monotonic() - 1 / RATE_HZ)
            time.sleep(max(0.0, due_s - time.monotonic()))
            yield frame, time.time_ns()


def jpeg_of(frame, quality):
    """Return a frame as JPEG, as OpenCV's users encode it."""
    return cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]


class Ages:
    """Notes the ages of frames, and reports those after the warm-up to the harness.

    Args:
        wanted: How many frames are measured.
        warm_up: How many before them are not.
    """

    def __init__(self, wanted, warm_up=WARM_UP):
        cv2.setNumThreads(1)
        self._wanted = wanted
        self._warm_up = warm_up
        self._arrived = 0
        self._ages_ms = []

    def note(self, stamp_ns):
        """Note a frame that is decoded now; return False when there are enough."""
        age_ms = (time.time_ns() - stamp_ns) / 1e6
        self._arrived += 1
        if self._arrived == self._warm_up:
            print("begin", flush=True)
        elif self._arrived > self._warm_up and len(self._ages_ms) < self._wanted:
            self._ages_ms.append(age_ms)
            if len(self._ages_ms) == self._wanted:
                print(json.dumps(self._ages_ms), flush=True)
                sys.stdin.read()  # the harness reads CPU time and memory first
        return len(self._ages_ms) < self._wanted
