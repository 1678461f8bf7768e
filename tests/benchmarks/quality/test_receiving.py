"""What arrives over the wire is sorted by frame, of the first run of the video only."""

from __future__ import annotations

from types import SimpleNamespace

from benchmarks.quality.tracker.wire import Receiver
from zenoh_vision.messages import Centroid, Header, Track, Tracks


def sample(message: Tracks | Centroid) -> SimpleNamespace:
    """Return what a subscriber gets, as far as it is read."""
    return SimpleNamespace(payload=SimpleNamespace(to_bytes=message.to_bytes))


def header(seq: int, epoch: int = 5) -> Header:
    return Header(camera="front", epoch=epoch, seq=seq, stamp_ns=1, width=64, height=48)


def track(identity: int, state: str) -> Track:
    return Track(id=identity, state=state, x=5, y=10, box=(0, 0, 10, 20), area=150)


def test_confirmed_tracks_are_kept_by_the_number_of_their_frame():
    receiver = Receiver()
    tracks = (track(1, "confirmed"), track(2, "tentative"), track(3, "lost"))
    receiver.on_tracks(sample(Tracks(header=header(7), tracks=tracks)))
    receiver.on_centroid(
        sample(Centroid(header=header(7), x=5, y=10, box=(0, 0, 10, 20), area=150.0))
    )
    assert receiver.boxes == {7: {1: (0.0, 0.0, 10.0, 20.0)}}
    assert receiver.centroids == {7: (0, 0, 10, 20)}
    assert receiver.newest == 7


def test_a_second_run_of_the_video_does_not_count():
    receiver = Receiver()
    for epoch in (5, 6):
        moving = (track(epoch, "confirmed"),)
        receiver.on_tracks(sample(Tracks(header=header(0, epoch), tracks=moving)))
        receiver.on_centroid(
            sample(Centroid(header=header(1, epoch), x=None, y=None, box=None, area=None))
        )
    assert set(receiver.boxes[0]) == {5}
    assert receiver.centroids == {1: None}
