"""Which picture and which result are put together, and into which file."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.headers import header
from zenoh_vision.config.settings import load_settings
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.image.forms import JPEG_FORM
from zenoh_vision.image.frame import Frame
from zenoh_vision.keys import JPEG
from zenoh_vision.messages import Centroid, Tracks
from zenoh_vision.stream.sample import Sample
from zv.tools.snapshot.joining import MAX_FRAMES, Join
from zv.tools.snapshot.options import SnapshotOptions
from zv.tools.snapshot.picture import Picture


def picture(seq: int, epoch: int = 1) -> Picture:
    frame = Frame(header(seq, epoch), np.zeros((48, 64, 3), np.uint8))
    return Picture(Sample("k", b"", JPEG), JPEG_FORM, frame)


def centroid(seq: int, epoch: int = 1) -> Centroid:
    return Centroid(header=header(seq, epoch), x=seq, y=0, box=None, area=None)


def test_only_a_result_of_the_same_frame_makes_a_pair():
    joined = Join("front", {Centroid})
    joined.add(header(5), picture(5))
    joined.add(header(4), centroid(4))
    joined.add(header(5, epoch=2), centroid(5, epoch=2))
    joined.add(header(5, camera="rear"), centroid(7))
    assert joined.newest() is None
    joined.add(header(5), centroid(5))
    found, result = joined.newest()
    assert (found.frame.header.seq, result.x) == (5, 5)


def test_the_newest_complete_frame_is_taken():
    joined = Join("front", {Centroid})
    for seq in (1, 3, 2):
        joined.add(header(seq), picture(seq))
        joined.add(header(seq), centroid(seq))
    joined.add(header(9), picture(9))
    assert joined.newest()[0].frame.header.seq == 3


def test_where_tracks_are_published_too_a_frame_waits_for_them():
    joined = Join("front", {Centroid, Tracks})
    joined.add(header(5), picture(5))
    joined.add(header(5), centroid(5))
    assert joined.newest() is None
    assert joined.newest(complete=False)[1].x == 5
    joined.add(header(5), Tracks(header=header(5), tracks=()))
    assert joined.newest()[1].tracks == ()


def test_frames_whose_other_half_never_comes_are_let_go():
    joined = Join("front", {Centroid})
    for seq in range(10 * MAX_FRAMES):
        joined.add(header(seq), picture(seq))
        joined.add(header(seq, epoch=2), centroid(seq, epoch=2))
    assert len(joined._pictures) == len(joined._results) == MAX_FRAMES


def test_a_file_whose_ending_names_no_format_is_refused_with_those_that_do():
    flags = {"key": "a/b", "output": "frame.txt"}
    with pytest.raises(ConfigurationError, match=r"allowed: a name that ends in \.jpg, .*; or -"):
        load_settings(SnapshotOptions, flags=flags)
    for name in ("a.JPG", "a.jpeg", "b/a.png", "-"):
        assert load_settings(SnapshotOptions, flags=flags | {"output": name}).output == name
