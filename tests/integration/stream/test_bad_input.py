"""A service survives whatever comes on its key, drops it by name, and goes on."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass

import msgpack
import numpy as np
import pytest
import zenoh

from tests.integration.conftest import LOSSLESS_ZV, QUICK_ZV, some_services
from tests.support.listening import Listener, newest, open_client, report_after, wait_for_nodes
from tests.support.pictures.encoded import PICTURES, damaged, forged_size
from tests.support.processes import Program, peak_bytes
from tests.support.publishing import IMAGE_KEY, PlainCamera, wait_for_subscriber
from tests.support.routing import Router
from tests.support.waiting import wait_until
from zenoh_vision.image import codecs
from zenoh_vision.image.codecs import MAX_COMPRESSED_BYTES

NODES = ("tracker_front", "edge_front")
COPIES = 4
DAY_NS = 86_400 * 10**9
GOOD = PICTURES[0]
Send = Callable[[PlainCamera], None]


def picture(payload: bytes, **changes: object) -> Send:
    """Return what sends a payload under a header of the stream, with changes."""

    def send(camera: PlainCamera) -> None:
        camera.put(payload, msgpack.packb(camera.header(GOOD, **changes)))

    return send


def attached(attachment: bytes | None) -> Send:
    """Return what sends a good picture with any attachment."""
    return lambda camera: camera.put(GOOD, attachment)


def stamped(offset_ns: int) -> Send:
    """Return what sends a good picture with a stamp that is off."""
    return lambda camera: picture(GOOD, stamp_ns=time.time_ns() + offset_ns)(camera)


# What is wrong, the reason under which it is counted. More that is wrong with a header is tried
# without a router, in tests/zenoh_vision/stream/test_identity.py and the vectors of headers.
BAD: dict[str, tuple[Send, str]] = {
    "not a JPEG": (picture(b"GIF89a" + bytes(500)), "not_an_image"),
    "empty": (picture(b""), "empty"),
    "truncated": (picture(GOOD[: len(GOOD) // 2]), "corrupt"),
    "corrupt entropy data": (picture(damaged(GOOD)), "corrupt"),
    "forged 32767x32767": (
        picture(forged_size(GOOD, 32767, 32767), width=32767, height=32767),
        "too_large",
    ),
    "forged size unlike the header's": (picture(forged_size(GOOD, 640, 480)), "wrong_size"),
    "too many bytes": (picture(GOOD + bytes(MAX_COMPRESSED_BYTES)), "too_large"),
    "attachment of garbage": (attached(b"\xc1garbage\xff" * 5), "bad_header"),
    "attachment huge": (attached(bytes(1_000_000)), "bad_header"),
    "another camera's header": (picture(GOOD, camera="rear"), "wrong_camera"),
    "an encoding nobody knows": (picture(GOOD, encoding="yuv422"), "unsupported_encoding"),
    "stamp days ahead": (stamped(3 * DAY_NS), "bad_stamp"),
    "no attachment beside an identified stream": (attached(None), "no_header"),
}


@dataclass
class System:
    """A tracker and an edge detector, fed by a plain publisher."""

    client: zenoh.Session
    programs: dict[str, Program]
    camera: PlainCamera
    centroids: Listener
    edges: Listener

    def feed(self) -> None:
        """Send good frames until one is seen by both."""
        wait_until(self._seen)

    def _seen(self) -> bool:
        seq, patience_s = self.camera.send(), time.monotonic() + 0.5
        while time.monotonic() < patience_s:
            if all(
                any(message.header["seq"] == seq for message in listener.messages[-5:])
                for listener in (self.centroids, self.edges)
            ):
                return True
            time.sleep(0.002)
        return False

    def wait_until_done(self, bad: int) -> None:
        """Wait until both nodes are done with the good frames and so many bad ones."""
        arrived = self.camera.seq - self._fed + bad

        def done(node: str) -> bool:
            counters = newest(self.client, f"@vision/diagnostics/{node}").body["counters"]
            gained = counters["received"] - self._counted[node]["received"]
            return gained >= arrived and not counters["pending"]

        try:
            wait_until(lambda: all(done(node) for node in NODES))
        except AssertionError:
            self._begin()  # what this test left behind must fail no other
            raise

    def gained(self, bad: int) -> dict[str, dict[str, int]]:
        """Return what each node counted since the last call, once it counted all that was sent.

        Args:
            bad: How many were sent beside the good frames.
        """
        arrived = self.camera.seq - self._fed + bad
        try:
            return self._gained(arrived)
        except AssertionError:
            self._begin()  # what this test left behind must fail no other
            raise

    def _gained(self, arrived: int) -> dict[str, dict[str, int]]:
        self._fed = self.camera.seq
        found = {}
        for node in NODES:
            before = self._counted[node]

            def all_arrived(node: str = node, before: dict[str, int] = before) -> dict[str, int]:
                counters = newest(self.client, f"@vision/diagnostics/{node}").body["counters"]
                return counters if counters["received"] >= before["received"] + arrived else {}

            self._counted[node] = wait_until(all_arrived)
            found[node] = difference(before, self._counted[node])
            assert found[node].pop("received") == arrived
        return found

    def __post_init__(self) -> None:
        self._begin()

    def _begin(self) -> None:
        """Count from now on, once both nodes see frames and nothing is on its way any more."""
        self.feed()
        self._fed = self.camera.seq
        self._counted = {node: self._counters_now(node) for node in NODES}

    def _counters_now(self, node: str) -> dict[str, int]:
        """Return the counters by a health message that was made after this call."""
        counters: dict[str, int] = report_after(self.client, node, time.time_ns()).body["counters"]
        return counters


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Iterator[System]:
    folder = tmp_path_factory.mktemp("bad input")
    with (
        # A starved node may read nothing for longer than the second after which a router drops
        # what it sends; here all that is sent has to arrive.
        closing(Router(folder, LOSSLESS_ZV)) as router,
        some_services(router.endpoint, folder, QUICK_ZV) as start,
    ):
        router.start()
        with open_client(router.endpoint) as client:
            yield a_system(client, start)


def a_system(client: zenoh.Session, start: Callable[..., Program]) -> System:
    # However busy the machine, no frame is late: each bad one is judged by what is wrong with it.
    programs = {
        f"{service}_front": start(service, "--max-age", 30) for service in ("tracker", "edge")
    }
    wait_for_nodes(client, *NODES)
    return System(
        client,
        programs,
        PlainCamera(client),
        Listener(client, "vision/front/centroid"),
        Listener(client, "vision/front/edges/compressed"),
    )


@pytest.mark.parametrize(("send", "reason"), BAD.values(), ids=BAD.keys())
def test_it_is_dropped_and_counted_exactly_and_the_next_good_frame_is_processed(
    system, send, reason
):
    system.feed()  # the stream is alive
    for sent in range(1, COPIES + 1):
        send(system.camera)
        # A corrupt frame is only counted when it is decoded, so before the next one comes.
        system.wait_until_done(sent)
    system.feed()
    for node, gained in system.gained(COPIES).items():
        gained.pop("dropped.overwritten", 0)  # good frames, on a busy machine
        assert gained.pop(f"dropped.{reason}") == COPIES
        assert gained.pop("processed") >= 1
        assert gained == {}, node
    for node, program in system.programs.items():
        assert program.process.poll() is None, f"{node} died: {program.complaints}"


def one_at_a_time(system: System, send: Send) -> None:
    """Send copies at the pace of a camera."""
    with (pace := system.camera.at(30, lambda: pace.calls < COPIES and send(system.camera))):
        wait_until(lambda: pace.calls >= COPIES, 20)


def difference(before: dict[str, int], after: dict[str, int]) -> dict[str, int]:
    """Return the counters that grew, and by how much."""
    names = after.keys() - {"pending", "missed"}
    grown = {name: after[name] - before.get(name, 0) for name in names}
    return {name: count for name, count in grown.items() if count}


def test_small_files_of_large_pictures_take_no_gigabytes(system):
    flat = np.full((4320, 7680), 90, np.uint16)
    deep, gray = codecs.encode_png(flat), codecs.encode_jpeg(flat.astype(np.uint8), "mono8", 80)
    # The costliest that the tracker takes, see its max_pixels: 16 bits, with alpha.
    allowed = codecs.encode_png(np.full((1200, 1920, 4), 90, np.uint16))
    for bytes_, width, height in ((gray, 7680, 4320), (deep, 7680, 4320), (allowed, 1920, 1200)):
        assert len(bytes_) < 400_000
        one_at_a_time(system, picture(bytes_, width=width, height=height, encoding="mono16"))
        system.feed()
    for node, gained in system.gained(3 * COPIES).items():
        assert gained["dropped.too_large"] == 2 * COPIES, node
    for node, program in system.programs.items():
        assert peak_bytes(program.process.pid) < 512 << 20, node  # a container's limit


def test_a_delete_is_dropped_as_empty(system):
    for _ in range(COPIES):
        system.client.delete(IMAGE_KEY)
    system.feed()
    for gained in system.gained(COPIES).values():
        assert gained["dropped.empty"] == COPIES


BUSY = ("than its stream", "more samples as", "waiting: no frame", "frames arrive on")
BUSY += ("objects that move farther",)
"""Logged on a slow machine: slowness, bursts that are over, a silence of 2 s, a rate too low."""


def test_each_reason_is_logged_once_per_burst(client, service):
    system = a_system(client, service)
    sends = [(send, reason) for what, (send, reason) in BAD.items() if what != "too many bytes"]
    bursts = sorted(sends * 3, key=lambda each: each[1])  # a reason's are one burst
    for sent, (send, reason) in enumerate(bursts, 1):
        system.feed()  # or a bare picture would find the identified stream silent, and be welcome
        send(system.camera)
        if reason == "corrupt":  # found when it is decoded, if no newer frame has replaced it
            system.wait_until_done(sent)
    system.feed()
    system.gained(3 * len(sends))
    reasons = {reason for _, reason in BAD.values()}
    for node, program in system.programs.items():
        said = [
            line
            for line in program.complaints.splitlines()
            if not any(words in line for words in BUSY)
        ]
        lines = [line for line in said if "WARNING" in line]
        logged = [line.split("dropped a sample, ")[1].split(":")[0] for line in lines]
        assert sorted(logged) == sorted(reasons), (node, lines)
        (other,) = set(said) - {*lines}
        assert "connected to the router at" in other
        assert program.output == ""


def test_bare_jpegs_alone_are_processed_under_an_identity_made_up_on_arrival(client, service):
    service("tracker")
    wait_for_nodes(client, "tracker_front")
    centroids = Listener(client, "vision/front/centroid")
    before_ns = time.time_ns()
    camera = PlainCamera(client)
    pictures = iter(PICTURES)
    wait_for_subscriber(client, IMAGE_KEY)  # a node is announced before it subscribes
    camera.put(next(pictures), None)
    centroids.wait_for(1)  # no later picture is to take the first one's place
    with camera.at(20, lambda: camera.put(next(pictures, GOOD), None)):
        headers = [message.header for message in centroids.wait_for(15)]
    for header in headers:
        assert header["assumed"] is True
        assert header["camera"] == "front"
        assert (header["width"], header["height"]) == (320, 240)
        assert before_ns < header["epoch"] <= header["stamp_ns"] <= header["received_ns"]
        assert header["done_ns"] < time.time_ns()
    assert len({header["epoch"] for header in headers}) == 1
    numbers = [header["seq"] for header in headers]
    assert numbers[0] == 0
    assert numbers == sorted(set(numbers))
    stamps = [header["stamp_ns"] for header in headers]
    assert stamps == sorted(set(stamps))


@pytest.mark.quiet
def test_a_flood_of_broken_pictures_leaves_the_frames_of_a_camera_alone(client, service):
    service("tracker")
    wait_for_nodes(client, "tracker_front")
    centroids = Listener(client, "vision/front/centroid")
    camera = PlainCamera(client)
    sends = [send for what, (send, _) in BAD.items() if what != "too many bytes"]
    sends += [picture(damaged(GOOD), epoch=time.time_ns() + number) for number in range(5)]
    turn = iter(range(10**9))

    def flood() -> None:
        sends[next(turn) % len(sends)](camera)

    with camera.at(15):  # a busy machine stops a process for longer than a frame of 30 Hz
        centroids.wait_for(10)
        quiet = share(camera, centroids, 30)
        with camera.at(200, flood) as flooding:
            flooded = share(camera, centroids, 60)
    assert flooding.calls > 400  # it was a flood
    assert flooded >= 0.9 * quiet, (flooded, quiet)


def share(camera: PlainCamera, centroids: Listener, frames: int) -> float:
    """Return the share of the camera's next frames that is processed."""
    first = camera.seq
    wait_until(lambda: camera.seq >= first + frames, 20)
    wanted = set(range(first, first + frames))
    wait_until(lambda: centroids.messages[-1].header["seq"] >= first + frames)
    return len(wanted & {message.header["seq"] for message in centroids.messages}) / frames
