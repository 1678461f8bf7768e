"""What is on the wire, seen by a plain Zenoh program: keys, encodings, headers, messages."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
import pytest
import zenoh

from tests.integration.conftest import LOSSLESS_ZV, a_router, some_services
from tests.support.listening import (
    Listener,
    Message,
    ask,
    balance,
    drops,
    living_nodes,
    newest,
    open_client,
    report_after,
    wait_for_nodes,
)
from tests.support.processes import Program
from tests.support.waiting import wait_until

SIZE = ("--width", 320, "--height", 240)
IDENTITY = ("camera", "epoch", "seq", "stamp_ns")
IMAGE_FIELDS = {"camera", "epoch", "seq", "stamp_ns", "width", "height", "encoding"} | {
    "node",
    "revision",
}
DERIVED_FIELDS = IMAGE_FIELDS - {"encoding"} | {"received_ns", "done_ns"}


@dataclass
class System:
    """A camera, a tracker and an edge detector that run, and a client."""

    client: zenoh.Session
    programs: dict[str, Program]

    def listen(self, suffix: str) -> Listener:
        """Subscribe to one key of the camera."""
        return Listener(self.client, f"vision/front/{suffix}")


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Iterator[System]:
    folder = tmp_path_factory.mktemp("wire")
    with (
        a_router(folder) as router,
        some_services(router.endpoint, folder, LOSSLESS_ZV) as start_lossless,
        some_services(router.endpoint, folder) as start,
        open_client(router.endpoint) as client,
    ):
        programs = {
            "camera_front": start_lossless("camera", "--rate", 20, *SIZE),
            "tracker_front": start("tracker", "--pipeline", "tutorial"),
            "edge_front": start("edge"),
        }
        wait_for_nodes(client, *programs)
        yield System(client, programs)


def png_depth_and_color(payload: bytes) -> tuple[int, int]:
    """Return bit depth and colour type of a PNG, from its IHDR chunk."""
    assert payload.startswith(b"\x89PNG\r\n\x1a\n")
    assert payload[12:16] == b"IHDR"
    return payload[24], payload[25]


def decoded(message: Message) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(message.payload, np.uint8), cv2.IMREAD_UNCHANGED)


def test_a_camera_frame_is_a_bare_jpeg_with_its_header_as_attachment(system):
    images = system.listen("image/compressed").wait_for(10)
    for image in images:
        assert image.encoding == "image/jpeg"
        assert image.payload.startswith(b"\xff\xd8\xff")
        assert image.payload.endswith(b"\xff\xd9")
        assert decoded(image).shape == (240, 320, 3)
        header = image.header
        assert set(header) == IMAGE_FIELDS
        assert header["camera"] == "front"
        assert header["node"] == "camera_front"
        assert header["encoding"] == "bgr8"
        assert (header["width"], header["height"]) == (320, 240)
        assert 0 <= image.age_s < 2
        assert time.time_ns() - 120e9 < header["epoch"] <= header["stamp_ns"]
    headers = [image.header for image in images]
    assert len({header["epoch"] for header in headers}) == 1
    numbers = [header["seq"] for header in headers]
    assert numbers == sorted(set(numbers))
    stamps = [header["stamp_ns"] for header in headers]
    assert stamps == sorted(set(stamps))


def test_a_centroid_carries_its_frames_identity_in_a_field_and_as_attachment(system):
    images, centroids = system.listen("image/compressed"), system.listen("centroid")
    heard = centroids.wait_for(10)
    last = heard[-1].header["seq"]
    wait_until(lambda: any(image.header["seq"] >= last for image in images.messages))
    identities = {tuple(image.header[name] for name in IDENTITY) for image in images.messages}
    for centroid in heard[2:]:  # whose frames came after the subscription
        assert centroid.encoding == "application/msgpack;vision.Centroid.v1"
        body = centroid.body
        assert set(body) == {"header", "x", "y", "box", "area"}
        header = body["header"]
        assert header == centroid.header
        assert set(header) == DERIVED_FIELDS
        assert header["node"] == "tracker_front"
        assert header["stamp_ns"] <= header["received_ns"] <= header["done_ns"] <= centroid.at_ns
        assert tuple(header[name] for name in IDENTITY) in identities
    assert len(heard) >= 10


def test_a_centroid_is_the_centre_of_its_box_or_nothing_at_all(system):
    centroids = system.listen("centroid")

    def moving() -> list[Message]:
        return [message for message in centroids.messages if message.body["box"] is not None]

    wait_until(lambda: len(moving()) >= 10)
    for message in centroids.messages:
        body = message.body
        if body["box"] is None:
            assert body["x"] is body["y"] is body["area"] is None
            continue
        x, y, width, height = body["box"]
        assert (body["x"], body["y"]) == (x + int(width / 2), y + int(height / 2))
        assert 0 <= x < x + width <= 320
        assert 0 <= y < y + height <= 240
        assert 0 <= body["area"] <= width * height


def test_there_is_one_centroid_for_every_processed_frame_also_when_nothing_moves(system):
    def lost(after_ns: int) -> int:
        """Return what the tracker had missed and dropped in all, by a report after a time."""

        found = report_after(system.client, "tracker_front", after_ns).body["counters"]
        return found.get("missed", 0) + drops(found)

    before = lost(0)
    centroids = system.listen("centroid").wait_for(20)
    numbers = [message.header["seq"] for message in centroids]
    missing = set(range(numbers[0], numbers[-1])) - set(numbers)
    assert numbers == sorted(set(numbers))
    # What a busy machine overwrites, at the camera, on the way or here, was not processed, and is
    # counted.
    assert len(missing) <= lost(centroids[-1].at_ns) - before


@pytest.mark.parametrize(
    ("suffix", "node"), [("mask", "tracker_front"), ("edges", "edge_front")], ids=["mask", "edges"]
)
def test_a_map_is_a_png_of_one_bit_a_pixel_with_0_and_255(system, suffix, node):
    found = system.listen(f"{suffix}/compressed").wait_for(3)[-1]
    assert found.encoding == "image/png"
    assert png_depth_and_color(found.payload) == (1, 0)  # one bit, grey
    pixels = decoded(found)
    assert pixels.shape == (240, 320)
    assert set(np.unique(pixels)) <= {0, 255}
    assert set(found.header) == IMAGE_FIELDS | {"received_ns", "done_ns"}
    assert found.header["encoding"] == "mono8"
    assert found.header["node"] == node


def test_health_comes_once_a_second_from_every_node_and_balances(system):
    for key in ("centroid", "edges/compressed"):
        system.listen(key).wait_for(2)  # a frame counts as processed when the next one is taken
    listeners = {
        node: Listener(system.client, f"@vision/diagnostics/{node}") for node in system.programs
    }
    for node, listener in listeners.items():
        messages = listener.wait_for(4)
        gaps = [(b.body["stamp_ns"] - a.body["stamp_ns"]) / 1e9 for a, b in pairwise(messages)]
        assert all(0.7 < gap < 1.5 for gap in gaps), (node, gaps)
        for message in messages:
            check_health(node, message)
        first, last = messages[0].body, messages[-1].body
        done = "published" if node == "camera_front" else "processed"
        assert last["counters"][done] > first["counters"][done]
        # Over 5 s, and not over the 3 s between these two: what a busy machine lets through varies.
        rate_hz = (last["counters"][done] - first["counters"][done]) / sum(gaps)
        assert rate_hz / 2 < last["rate_hz"] < rate_hz * 2
        assert 0 < last["latency_ms"]["p50"] <= last["latency_ms"]["p99"]


def check_health(node: str, message: Message) -> None:
    body = message.body
    assert message.encoding == "application/msgpack;vision.Diagnostics.v1"
    assert set(body) == {
        *("node", "stamp_ns", "level", "message", "uptime_s", "counters", "rate_hz"),
        *("latency_ms", "latency_histogram_ms"),
        *(() if node == "camera_front" else ("routes",)),
    }
    routes = set((body.get("routes") or {}).values())
    assert routes <= {"shm", "jpeg"}
    assert bool(routes) == (node != "camera_front")
    assert body["node"] == node
    # A machine that is too busy for 20 Hz is warned of, rightly: of its rate, or of frames that a
    # newer one replaced.
    words = body["message"]
    assert body["level"] == 0 or " Hz " in words or words == "dropping samples: overwritten", words
    assert abs(body["stamp_ns"] - message.at_ns) < 1e9
    assert set(body["latency_ms"]) == {"p50", "p99"}
    histogram = body["latency_histogram_ms"]
    assert set(histogram) == {"bounds", "counts", "sum"}
    assert len(histogram["counts"]) == len(histogram["bounds"]) + 1
    arrived = body["counters"]["captured" if node == "camera_front" else "received"]
    assert 0 < histogram["counts"][-1] <= arrived + 1  # the two are read one after the other
    assert balance(body["counters"]) == 0


TRACKER = {
    *("centroid", "tracks", "events"),
    *("tracked/compressed", "mask/compressed", "background/compressed"),
}
EDGES = {
    "edges/contours",
    *("edges/compressed", "edges/smoothed/compressed", "edges/magnitude/compressed"),
    *("edges/direction/compressed", "edges/suppressed/compressed"),
    "edges/thresholded/compressed",
}


@pytest.mark.parametrize(
    ("node", "publishes", "subscribes"),
    [
        ("camera_front", {"image/compressed", "image", "truth"}, set()),
        (
            "tracker_front",
            TRACKER,
            {"image/compressed"},
        ),
        ("edge_front", EDGES, {"image/compressed"}),
    ],
    ids=["camera", "tracker", "edge"],
)
def test_a_node_describes_itself(system, node, publishes, subscribes):
    wait_until(
        lambda: newest(system.client, f"@vision/node/{node}").body["subscribes"] or publishes
    )
    description = newest(system.client, f"@vision/node/{node}")
    assert description.encoding == "application/msgpack;vision.Node.v1"
    body = description.body
    assert set(body) == {
        *("node", "service", "cameras", "version", "host", "pid", "started_ns"),
        *("publishes", "subscribes", "stamp_ns"),
        *(["rate_hz"] if node == "camera_front" else []),
        *(["pipeline"] if node == "tracker_front" else []),
    }
    assert body["node"] == node
    assert abs(body["stamp_ns"] - description.at_ns) < 1e9
    assert body.get("rate_hz", 20) == 20  # the camera's
    assert body.get("pipeline", "tutorial") == "tutorial"  # the tracker's
    assert body["service"] == node.split("_")[0]
    assert body["cameras"] == ["front"]
    assert body["pid"] == system.programs[node].process.pid
    assert 0 < time.time_ns() - body["started_ns"] < 300e9
    assert {f"vision/front/{suffix}" for suffix in publishes} == set(body["publishes"])
    assert {f"vision/front/{suffix}" for suffix in subscribes} == set(body["subscribes"])


def test_every_node_shows_a_token_that_no_wildcard_of_data_matches(system):
    tokens = {f"@vision/node/{node}" for node in ("camera_front", "tracker_front", "edge_front")}
    wait_until(lambda: living_nodes(system.client) == tokens)
    data = Listener(system.client, "**")
    found = {message.key for message in data.wait_for(30)}
    data.close()
    assert found <= {
        f"vision/front/{suffix}"
        for suffix in (*("image/compressed", "image", "truth", *TRACKER, *EDGES),)
    }


SCHEMAS = (
    *("Header", "Centroid", "Contours", "Tracks", "TrackEvent", "Prediction"),
    *("Diagnostics", "Node"),
    *("Parameter", "ParameterList", "Refusal"),
)


def test_a_query_for_all_schemas_answers_every_message_under_both_names(system):
    found = {reply.key for reply in ask(system.client, "@vision/schema/*")}
    assert found == {
        f"@vision/schema/{prefix}{name}{suffix}"
        for name in SCHEMAS
        for prefix, suffix in (("", ""), ("vision.", ".v1"))
    }
