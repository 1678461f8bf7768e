"""Runs of a source: a new one starts afresh, an old one does not come back while it lives."""

from __future__ import annotations

import cv2
import numpy as np

from tests.support.listening import Listener, wait_for_nodes
from tests.support.pictures.encoded import HEIGHT, STILL, WIDTH, jpeg, scene
from tests.support.publishing import IMAGE_KEY, PlainCamera, wait_for_subscriber
from tests.support.waiting import wait_until

# With shadows on, MOG2 takes the very first frame for shadow, 127, which the threshold drops;
# with shadows off it takes it for foreground: the whole picture.
TUTORIAL = ("--pipeline", "tutorial", "--no-detect-shadows")


def first_frames_box(picture: bytes) -> list[int]:
    """Return what the tutorial's own chain finds in the first frame it ever sees."""
    bgr = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    mask = cv2.createBackgroundSubtractorMOG2(700, 25, False).apply(bgr)
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((20, 20), np.uint8))
    _, mask = cv2.threshold(cv2.medianBlur(mask, 5), 127, 255, cv2.THRESH_BINARY)
    contours, _ = cv2.findContours(mask, cv2.RETR_TREE, cv2.CHAIN_APPROX_SIMPLE)
    return list(cv2.boundingRect(max(contours, key=cv2.contourArea)))


def test_a_new_epoch_starts_a_new_background(client, quick_service):
    centroids = tracker(client, quick_service, *TUTORIAL)
    old = PlainCamera(client, pictures=(STILL,))
    with old.at(30):
        wait_until(lambda: len(centroids.messages) > 5 and not centroids.messages[-1].body["box"])
    new = PlainCamera(client, pictures=(STILL,))
    new.send()
    first = wait_until(lambda: of_epoch(centroids, new.epoch))[0]
    assert first.body["box"] == first_frames_box(STILL) == [0, 0, WIDTH, HEIGHT]
    new.send()
    assert not wait_until(lambda: of_epoch(centroids, new.epoch)[1:])[0].body["box"]


def test_a_new_size_starts_a_new_background(client, quick_service):
    centroids = tracker(client, quick_service, *TUTORIAL)
    camera = PlainCamera(client, pictures=(STILL,))
    with camera.at(30):
        wait_until(lambda: len(centroids.messages) > 5 and not centroids.messages[-1].body["box"])
    half = jpeg(cv2.resize(scene(None), (WIDTH // 2, HEIGHT // 2)))
    seq = camera.send(half)
    found = wait_until(lambda: [m for m in centroids.messages if m.header["seq"] == seq])[0]
    assert found.body["box"] == [0, 0, WIDTH // 2, HEIGHT // 2]
    assert (found.header["width"], found.header["height"]) == (WIDTH // 2, HEIGHT // 2)


def tracker(client, quick_service, *flags: str) -> Listener:
    # A single frame must count also where the machine is so busy that it is seen late.
    quick_service("tracker", "--max-age", 30, *flags)
    wait_for_nodes(client, "tracker_front")
    wait_for_subscriber(client, IMAGE_KEY)  # a token says nothing of it
    return Listener(client, "vision/front/centroid")


def of_epoch(listener: Listener, epoch: int) -> list:
    return [message for message in listener.messages if message.header["epoch"] == epoch]
