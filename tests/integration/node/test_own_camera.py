"""A camera of one's own has what ``zv camera`` has: identity, counters, health, parameters."""

from __future__ import annotations

from typing import Annotated, ClassVar

import cv2
import msgpack
import numpy as np
import pytest
import zenoh
from pydantic import Field

from tests.support.clocks import SteppedClock
from tests.support.listening import Listener, balance, newest
from tests.support.pictures.encoded import PICTURES
from tests.support.pictures.videos import jpeg_of, noise
from tests.support.waiting import wait_until
from zenoh_vision import (
    Frame,
    Header,
    Level,
    Live,
    Node,
    Settings,
    Stamped,
    Tracks,
    message_topic,
)
from zenoh_vision.config.roles import Role
from zenoh_vision.image.codecs import encode_png
from zenoh_vision.image.picture import PixelPicture
from zenoh_vision.node.outputs import Published
from zenoh_vision.stream.frame_intake import snapshot_of
from zenoh_vision.stream.sample import Sample
from zenoh_vision.transport import publisher

COMPRESSED = "vision/front/image/compressed"
RAW = "vision/front/image"
PIXELS = np.full((48, 64, 3), 90, np.uint8)
FRAME_HEADER = Header(
    camera="front", epoch=1, seq=0, stamp_ns=1, width=64, height=48, encoding="bgr8"
)


class LensSettings(Settings):
    env_prefix: ClassVar[str] = "ZV_LENS_"

    fineness: Annotated[
        int, Field(ge=1, le=100, description="of the JPEGs"), Live(), Role("quality")
    ] = 80
    quality: Annotated[int, Field(description="of the glass")] = 3


@pytest.fixture(autouse=True)
def lossless(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let frames wait for a busy machine's network, since each of them is expected."""
    delivery = (zenoh.CongestionControl.BLOCK, zenoh.Priority.DATA)
    monkeypatch.setattr(publisher, "FRAME_DELIVERY", delivery)


def test_pictures_become_frames_with_numbers_in_one_epoch_and_are_counted(client, connection):
    pictures = Listener(client, COMPRESSED)
    with Node("camera", connection=connection, publishes=["image/compressed"]) as node:
        wait_until(lambda: node.wanted("image/compressed"))
        sent = [node.publish_picture("image/compressed", PIXELS) for _ in range(3)]
        first, found = sent[0].frame, pictures.wait_for(3)
        counted = node.counters.snapshot()
    assert [each.outcome for each in sent] == ["sent"] * 3
    assert [each.header["seq"] for each in found] == [0, 1, 2]
    assert {each.header["epoch"] for each in found} == {first.header.epoch}
    assert {each.header["node"] for each in found} == {"camera_front"}
    assert (first.header.width, first.header.height, first.header.encoding) == (64, 48, "bgr8")
    assert counted == {"captured": 3, "published": 3, "pending": 0}


def test_a_jpeg_that_was_sent_counts_as_published_though_its_pixels_cannot_be_decoded(
    client, connection
):
    corrupt = jpeg_of(noise(*PIXELS.shape))[:-99]
    pictures, raw = Listener(client, COMPRESSED), Listener(client, RAW)
    with Node("camera", connection=connection, publishes=["image/compressed", "image"]) as node:
        wait_until(lambda: node.wanted("image/compressed"))
        wait_until(lambda: node.wanted("image"))
        for _ in range(3):
            assert node.publish_picture("image/compressed", corrupt)
        pictures.wait_for(3)
        assert node.counters.snapshot() == {
            "captured": 3,
            "published": 3,
            "pending": 0,
            "not_decoded": 3,
        }
        assert node.health.diagnostics().level == Level.WARN
    assert not raw.messages


def test_a_jpeg_that_nobody_gets_since_its_pixels_cannot_be_decoded_is_dropped(client, connection):
    corrupt = jpeg_of(noise(*PIXELS.shape))[:-99]
    raw = Listener(client, RAW)
    with Node("camera", connection=connection, publishes=["image/compressed", "image"]) as node:
        wait_until(lambda: node.wanted("image"))
        assert node.publish_picture("image/compressed", corrupt) == Published("dropped", None)
        counted = node.counters.snapshot()
    assert counted == {"captured": 1, "published": 0, "dropped.corrupt": 1, "pending": 0}
    assert not raw.messages


def test_what_nobody_subscribes_to_is_counted_so_and_kept_for_a_snapshot(client, connection):
    with Node("camera", connection=connection, publishes=["image/compressed"]) as node:
        node.publish_picture("image/compressed", np.zeros((48, 64), np.uint16))
        assert newest(client, COMPRESSED).encoding == "image/png"
        diagnostics = node.health.diagnostics()
    expected = {"captured": 1, "published": 0, "dropped.no_subscriber": 1, "pending": 0}
    assert diagnostics.counters == expected
    assert balance(diagnostics.counters) == 0
    assert diagnostics.level == Level.OK
    assert diagnostics.latency_ms.p50 is not None


def test_a_frame_over_the_budget_is_counted_so_but_its_raw_pixels_are_sent(client, connection):
    topics = ["image/compressed", "image"]
    pictures = Listener(client, COMPRESSED)
    with Node("camera", connection=connection, publishes=topics) as node:
        wait_until(lambda: node.wanted("image/compressed"))
        node.publish_picture("image/compressed", PIXELS)
        pictures.wait_for(1)
        for _ in range(2):
            found = node.publish_picture("image/compressed", PIXELS, compress=lambda _: None)
            assert found.outcome == "withheld"
        withheld = node.counters.snapshot()
        raw = Listener(client, RAW)
        wait_until(lambda: node.wanted("image"))
        found = node.publish_picture("image/compressed", PIXELS, compress=lambda _: None)
        assert found.outcome == "sent"
        raw.wait_for(1)
        counted = node.counters.snapshot()
        assert len(pictures.messages) == 1
    assert withheld == {"captured": 3, "published": 1, "dropped.over_budget": 2, "pending": 0}
    assert counted == {"captured": 4, "published": 2, "dropped.over_budget": 2, "pending": 0}


def test_a_source_that_was_opened_again_begins_a_new_epoch_at_0(connection):
    with Node("camera", connection=connection, publishes=["image"]) as node:
        before, again, after = (
            node.publish_picture("image/compressed", PIXELS, new_epoch=new).frame
            for new in (False, True, False)
        )
    assert before.header.epoch < again.header.epoch == after.header.epoch
    assert [each.header.seq for each in (before, again, after)] == [0, 0, 1]


def test_a_jpeg_is_published_unchanged(client, connection):
    with Node("camera", connection=connection, publishes=["image/compressed"]) as node:
        node.publish_picture("image/compressed", PICTURES[0])
        assert newest(client, COMPRESSED).payload == PICTURES[0]


def test_a_png_of_16_bits_is_named_so(client, connection):
    depth = np.full((48, 64), 1234, np.uint16)
    with Node("camera", connection=connection, publishes=["image/compressed"]) as node:
        frame = node.publish_picture("image/compressed", encode_png(depth)).frame
        assert newest(client, COMPRESSED).header["encoding"] == "mono16"
        assert np.array_equal(frame.pixels, depth)
        eight_bits = node.publish_picture("image/compressed", encode_png(PIXELS)).frame
    assert eight_bits.header.encoding == "bgr8"


INVALID = {
    "no picture": (b"GIF89a", None, "not_an_image"),
    "floats": (np.zeros((4, 4), np.float64), None, "unsupported_encoding"),
    "another encoding": (PIXELS, "mono8", "unsupported_encoding"),
    "an unknown encoding": (PIXELS, "yuv422", "unsupported_encoding"),
    "no rows": (np.zeros((0, 4), np.uint8), None, "too_large"),
    "too many rows": (np.zeros((65_501, 4), np.uint8), None, "too_large"),
    "a row": (np.zeros(16, np.uint8), "mono8", "unsupported_encoding"),
    "a row without encoding": (np.zeros(16, np.uint8), None, "unsupported_encoding"),
    "None": (None, "mono8", "unsupported_encoding"),
}


@pytest.mark.parametrize(("picture", "encoding", "reason"), INVALID.values(), ids=INVALID)
def test_an_invalid_picture_is_dropped_and_the_next_one_is_published(
    connection, picture, encoding, reason
):
    with Node("camera", connection=connection, publishes=["image/compressed"]) as node:
        found = node.publish_picture("image/compressed", picture, encoding=encoding)
        assert found == Published("dropped", None)
        assert node.publish_picture("image/compressed", PIXELS).frame.header.seq == 1
        counted = node.counters.snapshot()
    assert counted[f"dropped.{reason}"] == 1
    assert balance(counted) == 0


def test_a_changed_parameter_holds_from_the_next_picture_on(client, connection):
    noise = np.random.default_rng(1).integers(0, 256, (48, 64, 3), np.uint8)
    with Node(
        "camera",
        connection=connection,
        publishes=["image/compressed"],
        parameters=LensSettings(),
    ) as node:
        fine = node.publish_picture("image/compressed", noise).frame
        node.parameters.change({"fineness": 1})
        node.publish_picture("image/compressed", noise)  # begun before the change
        coarse = node.publish_picture("image/compressed", noise).frame
        said = newest(client, "@vision/param/camera_front/fineness")  # the router knows it soon
    assert said.body["value"] == 1
    assert [fine.header.revision, coarse.header.revision] == [0, 1]
    assert len(coarse.compressed) < len(fine.compressed) / 3


def test_only_the_keys_that_are_named_are_declared(client, connection):
    with Node(
        "stereo",
        camera=("left", "right"),
        connection=connection,
        publishes={"left": ["image/compressed", "centroid"], "right": []},
    ) as node:
        said = newest(client, "@vision/node/stereo").body["publishes"]
        with pytest.raises(ValueError, match=r"does not publish image/compressed of right; it pub"):
            node.publish_picture("image/compressed", PIXELS, camera="right")
        with pytest.raises(ValueError, match="does not publish"):
            node.publish_picture(
                "image/compressed",
                Frame(FRAME_HEADER.model_copy(update={"camera": "right"}), PIXELS),
            )
        assert node.counters.snapshot() == {"captured": 0, "published": 0, "pending": 0}
    assert said == ["vision/left/image/compressed", "vision/left/centroid"]
    with pytest.raises(ValueError, match=r"stereo publishes of 'up', but serves \('left',\)"):
        Node("stereo", camera=("left",), publishes={"up": []})


def test_a_node_that_is_used_wrongly_says_how_it_is_used(connection):
    node = Node("lamp", connection=connection, publishes=["image/compressed", "centroid"])
    with pytest.raises(RuntimeError, match="lamp_front is not open: use it inside `with`"):
        node.publish_picture("image/compressed", PIXELS)
    with node:
        with pytest.raises(TypeError, match="centroid carries Centroid, not dict"):
            node.publish("centroid", {"x": 1})  # type: ignore[arg-type]
        with pytest.raises(TypeError, match="centroid carries Centroid, not Tracks"):
            node.publish("centroid", Tracks(header=FRAME_HEADER, tracks=()))
        with pytest.raises(TypeError, match="image/compressed carries pictures, not messages"):
            node.publish("image/compressed", Tracks(header=FRAME_HEADER, tracks=()))
        with pytest.raises(
            ValueError, match="does not publish prediction of front; it publishes i"
        ):
            node.publish("prediction", Tracks(header=FRAME_HEADER, tracks=()))
    with pytest.raises(RuntimeError, match="lamp_front was opened before; make another Node"):
        node.__enter__()


@pytest.mark.parametrize("has_input", [False, True])
def test_a_next_picture_counts_and_a_frame_made_elsewhere_does_not_whatever_else_is_open(
    connection, has_input
):
    with Node("camera", connection=connection, publishes=["image"]) as node:
        if has_input:
            node.messages("truth")
        node.publish_picture("image", PIXELS)
        assert node.counters.snapshot()["captured"] == 1
        found = node.publish_picture("image", Frame(FRAME_HEADER, PIXELS))
        assert (found.outcome, found.frame.header) == ("unwanted", FRAME_HEADER)
        assert node.counters.snapshot()["captured"] == 1


def test_pixels_that_are_changed_after_they_were_published_do_not_change_what_is_kept(
    client, connection
):
    canvas = np.full((48, 64, 3), 200, np.uint8)
    with Node("camera", connection=connection, publishes=["image", "tracked/compressed"]) as node:
        frame = node.publish_picture("image", canvas).frame
        node.publish_picture("tracked/compressed", canvas, frame=frame)
        canvas[:] = 10
        assert set(newest(client, RAW).payload) == {200}
        tracked = newest(client, "vision/front/tracked/compressed").payload
        assert cv2.imdecode(np.frombuffer(tracked, np.uint8), 1).min() > 190


def test_a_crop_of_a_frame_says_its_size_and_a_reduced_picture_keeps_its_frames(client, connection):
    whole = noise(96, 128)
    with Node("camera", connection=connection, publishes=["image", "tracked/compressed"]) as node:
        frame = node.publish_picture("image", whole).frame
        key = "vision/front/tracked/compressed"
        for picture, shape in (
            (whole[:40, 10:70], (40, 60)),
            (PixelPicture(whole).scaled(64, 48), (96, 128)),
            (whole[24:72, 32:96], (48, 64)),  # of the frame's shape, but a part of it
            (whole, (96, 128)),
        ):
            node.publish_picture("tracked/compressed", picture, frame=frame)
            found = newest(client, key)
            assert (found.header["height"], found.header["width"]) == shape
            assert (found.header["epoch"], found.header["seq"]) == (
                frame.header.epoch,
                frame.header.seq,
            )
            sample = Sample(key, found.payload, attachment=msgpack.packb(found.header))
            assert snapshot_of(sample).bgr.shape == (*shape, 3)


def test_recorded_bytes_are_published_as_they_are(client, connection):
    attachment = FRAME_HEADER.to_bytes()
    with Node("player", connection=connection, publishes=["image/compressed"]) as node:
        assert not node.publish_bytes(
            "image/compressed", PICTURES[0], encoding="image/jpeg", attachment=attachment
        )
        found = newest(client, COMPRESSED)
    assert (found.payload, found.encoding) == (PICTURES[0], "image/jpeg")
    assert found.header["seq"] == FRAME_HEADER.seq


def test_an_epoch_never_runs_backwards_with_the_clock(connection):
    clock = SteppedClock()
    with Node("camera", connection=connection, publishes=["image"], clock=clock) as node:
        before = node.publish_picture("image", PIXELS).frame
        clock.wall_ns -= 3600 * 10**9
        after = node.publish_picture("image", PIXELS, new_epoch=True).frame
    assert after.header.epoch > before.header.epoch


@pytest.mark.parametrize(
    ("picture", "options", "said"),
    [
        (Frame(FRAME_HEADER, PIXELS), {"quality": 5}, "quality= is not for a frame that has its"),
        (PIXELS, {"bilevel": True}, "bilevel= is not for the next frame of a camera; allowed: cam"),
        (PIXELS, {"frame": Frame(FRAME_HEADER, PIXELS), "stamp_ns": 1}, "stamp_ns= is not for a r"),
    ],
)
def test_an_argument_that_would_have_no_effect_is_refused(connection, picture, options, said):
    with (
        Node("camera", connection=connection, publishes=["image"]) as node,
        pytest.raises(ValueError, match=said),
    ):
        node.publish_picture("image", picture, **options)
    assert node.counters.snapshot()["captured"] == 0


def test_a_result_without_its_frame_is_refused(connection):
    with Node("camera", connection=connection, publishes=["image", "tracked/compressed"]) as node:
        for wrong in (
            lambda: node.publish_picture("tracked/compressed", PIXELS),
            lambda: node.publish_picture("image", lambda: PIXELS),
        ):
            with pytest.raises(ValueError, match="a result names the frame"):
                wrong()


def test_the_pictures_of_all_forms_are_the_same_pixels(client, connection):
    gradient = np.arange(48 * 64, dtype=np.uint16).reshape(48, 64)
    with Node("camera", connection=connection, publishes=["image", "image/compressed"]) as node:
        node.publish_picture("image/compressed", gradient)
        raw, png = newest(client, "vision/front/image"), newest(client, COMPRESSED)
    assert raw.payload == gradient.tobytes()
    decoded = cv2.imdecode(np.frombuffer(png.payload, np.uint8), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(decoded, gradient)


class Added(Stamped):
    """A message of a camera that is added later."""

    schema_name: ClassVar[str] = "my.Added.v1"


def test_the_schemas_of_a_camera_that_was_added_are_answered_too(client, connection):
    topic = message_topic("added", Added)
    with Node("stereo", camera=(), connection=connection, publishes={}) as node:
        node.add_camera("left", [topic])
        wait_until(lambda: newest(client, "@vision/schema/my.Added.v1"))
