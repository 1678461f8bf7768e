"""Which picture and which result are put together."""

from __future__ import annotations

from common.keys import JPEG
from common.messages import Centroid, Header, Tracks
from services.tools.snapshot.joining import MOST_FRAMES, Join
from services.tools.snapshot.shot import Shot


def header(seq: int, epoch: int = 1) -> Header:
    return Header(camera="front", epoch=epoch, seq=seq, stamp_ns=3, width=320, height=240)


def shot(seq: int, epoch: int = 1) -> Shot:
    return Shot("k", JPEG, b"", header(seq, epoch))


def centroid(seq: int, epoch: int = 1) -> Centroid:
    return Centroid(header=header(seq, epoch), x=seq, y=0, box=None, area=None)


def test_only_a_result_of_the_same_frame_makes_a_pair():
    joined = Join("front", frozenset({"centroid"}))
    joined.add((1, 5), shot=shot(5))
    joined.add((1, 4), centroid=centroid(4))
    joined.add((2, 5), centroid=centroid(5, epoch=2))
    assert joined.complete() is None
    joined.add((1, 5), centroid=centroid(5))
    pair = joined.complete()
    assert (pair.shot.header.seq, pair.centroid.x) == (5, 5)


def test_the_newest_complete_frame_is_taken():
    joined = Join("front", frozenset({"centroid"}))
    for seq in (1, 3, 2):
        joined.add((1, seq), shot=shot(seq), centroid=centroid(seq))
    joined.add((1, 9), shot=shot(9))
    assert joined.complete().shot.header.seq == 3


def test_where_tracks_are_published_too_a_frame_waits_for_them():
    joined = Join("front", frozenset({"centroid", "tracks"}))
    joined.add((1, 5), shot=shot(5), centroid=centroid(5))
    assert joined.complete() is None
    assert joined.incomplete().centroid.x == 5
    joined.add((1, 5), tracks=Tracks(header=header(5), tracks=()))
    assert joined.complete().tracks.tracks == ()


def test_frames_whose_other_half_never_comes_are_let_go():
    joined = Join("front", frozenset({"centroid"}))
    for seq in range(10 * MOST_FRAMES):
        joined.add((1, seq), shot=shot(seq))
    assert len(joined._pairs) == MOST_FRAMES
