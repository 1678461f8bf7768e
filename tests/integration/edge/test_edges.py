"""The edge detector over a router: steps and lines of the same frame, live settings, bits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import cv2
import msgpack
import numpy as np
import pytest
import zenoh

from tests.integration.conftest import a_router, some_services
from tests.support.listening import Listener, Message, newest, open_client, wait_for_nodes
from tests.support.pictures.encoded import HEIGHT, PICTURES, WIDTH
from tests.support.publishing import PlainCamera
from tests.support.waiting import wait_until
from zenoh_vision.image.forms import unpack_bits
from zenoh_vision.messages import Contours, ParameterList

STAGES = ("smoothed", "magnitude", "direction", "suppressed", "thresholded")
EDGE = "@vision/set/edge_front"


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[zenoh.Session]:
    """A session beside an edge detector that no frame is too old for."""
    folder = tmp_path_factory.mktemp("edges")
    with (
        a_router(folder) as router,
        some_services(router.endpoint, folder) as start,
        open_client(router.endpoint) as session,
    ):
        start("edge", "--max-age", 30)
        wait_for_nodes(session, "edge_front")
        yield session


@pytest.fixture
def camera(client: zenoh.Session) -> Iterator[PlainCamera]:
    """A camera that sends; the detector's settings are its defaults before and after."""
    camera = PlainCamera(client)
    with camera.at(20):
        yield camera
    set_all(client, detector="canny", format="png", region="", sigma=1.4)


def set_all(client: zenoh.Session, **values: object) -> int:
    """Set parameters; return the revision that has them."""
    (reply,) = client.get(EDGE, payload=msgpack.packb(values), timeout=10.0)
    assert reply.ok is not None, reply.err and msgpack.unpackb(reply.err.payload.to_bytes())
    return ParameterList.from_bytes(reply.ok.payload.to_bytes()).revision


def pixels(message: Message) -> Any:
    return cv2.imdecode(np.frombuffer(message.payload, np.uint8), cv2.IMREAD_UNCHANGED)


def of_one_frame(listeners: dict[str, Listener]) -> dict[str, Message]:
    """Return what came on all keys of the newest frame that all have."""

    def common() -> dict[str, Message] | None:
        by_seq = {
            name: {message.header["seq"]: message for message in listener.messages}
            for name, listener in listeners.items()
        }
        shared = set.intersection(*(set(found) for found in by_seq.values()))
        return {name: found[max(shared)] for name, found in by_seq.items()} if shared else None

    return wait_until(common)


def test_steps_and_lines_belong_to_the_same_frame_as_the_edge_map(client, camera):
    keys = ["compressed", "contours", *(f"{stage}/compressed" for stage in STAGES)]
    listeners = {key: Listener(client, f"vision/front/edges/{key}") for key in keys}
    found = of_one_frame(listeners)
    seq = found["compressed"].header["seq"]
    gray = cv2.imdecode(
        np.frombuffer(PICTURES[seq % len(PICTURES)], np.uint8), cv2.IMREAD_GRAYSCALE
    )
    smoothed = cv2.GaussianBlur(gray, (0, 0), 1.4)
    edges = cv2.Canny(smoothed, 40, 100, L2gradient=True)
    assert np.array_equal(pixels(found["compressed"]), edges)
    assert np.array_equal(pixels(found["smoothed/compressed"]), smoothed)
    shown = pixels(found["thresholded/compressed"])
    assert set(np.unique(shown)) <= {0, 128, 255}
    assert (shown[edges > 0] > 0).all()
    assert pixels(found["direction/compressed"]).shape == (HEIGHT, WIDTH, 3)
    lines = Contours.from_bytes(found["contours"].payload)
    assert lines.density == pytest.approx(np.count_nonzero(edges) / edges.size)
    assert all(edges[y, x] for line in lines.contours for x, y in line.points)
    assert {message.header["epoch"] for message in found.values()} == {camera.epoch}
    for listener in listeners.values():
        listener.close()


def test_the_detector_can_be_changed_while_it_runs(client, camera):
    edges = Listener(client, "vision/front/edges/compressed")
    before = edges.wait_for(1)[-1].header["revision"]
    set_all(client, detector="haralick")
    changed = wait_until(
        lambda: [each for each in edges.messages if each.header["revision"] > before]
    )[0]
    assert set(np.unique(pixels(changed))) == {0, 255}
    edges.close()


@pytest.mark.parametrize("detector", ["colour", "haralick", "canny"])
def test_a_query_returns_each_step_of_every_detector(client, camera, detector):
    revision = set_all(client, detector=detector)
    for name in (*STAGES, ""):
        key = f"vision/front/edges/{name}/compressed".replace("//", "/")
        wait_until(lambda key=key: newest(client, key).header["revision"] >= revision)


def test_bits_are_the_same_map_as_the_png(client, camera):
    edges = Listener(client, "vision/front/edges/compressed")
    wait_until(
        lambda: (
            len({each.header["seq"] % len(PICTURES) for each in edges.messages}) == len(PICTURES)
        )
    )
    set_all(client, format="bits")
    bits = wait_until(
        lambda: [each for each in edges.messages if each.encoding.endswith("Bits.v1")]
    )[0]
    picture = bits.header["seq"] % len(PICTURES)
    twin = next(
        each
        for each in edges.messages
        if each.encoding == "image/png" and each.header["seq"] % len(PICTURES) == picture
    )
    assert np.array_equal(unpack_bits(bits.payload, WIDTH, HEIGHT), pixels(twin))
    assert len(bits.payload) == WIDTH * HEIGHT / 8
    edges.close()


def test_a_region_outside_of_the_frame_is_counted_until_it_is_inside(client, camera):
    edges = Listener(client, "vision/front/edges/compressed")
    health = Listener(client, "@vision/diagnostics/edge_front")
    edges.wait_for(1)
    set_all(client, region="5000,0,10,10")

    def counted() -> dict[str, int] | None:
        return next(
            (
                each.body["counters"]
                for each in health.messages
                if each.body["counters"].get("region_outside")
            ),
            None,
        )

    counters = wait_until(counted)
    dropped = sum(count for name, count in counters.items() if name.startswith("dropped."))
    assert counters["received"] == counters["processed"] + dropped + counters["pending"]
    set_all(client, region="100,80,120,60")
    seen = edges.messages[-1].header["seq"]
    after = wait_until(lambda: [each for each in edges.messages if each.header["seq"] > seen])[-1]
    found = pixels(after)
    assert not found[:80].any()
    assert not found[:, 220:].any()
    for listener in (edges, health):
        listener.close()
