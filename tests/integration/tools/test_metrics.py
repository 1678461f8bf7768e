"""``zv metrics`` beside real nodes, made-up ones and none: scraped over HTTP."""

from __future__ import annotations

import re
import signal
import socket
import time
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import msgpack
import pytest
import zenoh
from prometheus_client.parser import text_string_to_metric_families as parse

from tests.integration.conftest import a_router, some_services
from tests.support.fork_server import ZV
from tests.support.listening import open_client, wait_for_nodes
from tests.support.processes import START_S, Program
from tests.support.publishing import KEPT
from tests.support.routing import Router
from tests.support.waiting import wait_until
from zenoh_vision.health.fleet import GONE_S
from zv.tools.metrics.serving import IDLE_S

HEALTH = {
    "node": "x",
    "stamp_ns": 1,
    "level": 0,
    "message": "ok",
    "uptime_s": 1.0,
    "counters": {"received": 5, "processed": 5, "pending": 0},
    "rate_hz": 1.0,
    "latency_ms": {"p50": None, "p99": None},
}


@dataclass
class Exporter:
    """A running ``zv metrics`` and what it serves."""

    program: Program

    @property
    def url(self) -> str:
        return self.program.lines(r"http://\S+/metrics")[0][0]

    def scrape(self) -> dict[tuple[str, ...], float]:
        """Return every series as (name, label values in order of their names) and its value."""
        with urllib.request.urlopen(self.url, timeout=START_S) as answer:
            text = answer.read().decode()
        return {
            (sample.name, *(sample.labels[name] for name in sorted(sample.labels))): sample.value
            for family in parse(text)
            for sample in family.samples
        }

    def until(
        self, condition: Callable[[dict[tuple[str, ...], float]], object]
    ) -> dict[tuple[str, ...], float]:
        """Return the first scrape that fulfils a condition."""
        found: dict[tuple[str, ...], float] = {}

        def fulfilled() -> bool:
            found.clear()
            found.update(self.scrape())
            return bool(condition(found))

        wait_until(fulfilled, explain=lambda: f"{found} {self.program.complaints}")
        return found

    def value(self, name: str, *labels: str) -> float | None:
        return self.scrape().get((f"zenoh_vision_{name}", *labels))


@dataclass
class System:
    router: Router
    client: zenoh.Session
    programs: dict[str, Program]
    exporter: Exporter


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Iterator[System]:
    folder = tmp_path_factory.mktemp("metrics")
    with (
        a_router(folder) as router,
        some_services(router.endpoint, folder) as start,
        open_client(router.endpoint) as client,
    ):
        exporter = Exporter(start("metrics", "--listen", "127.0.0.1:0"))
        small = ("--width", 64, "--height", 48, "--rate", 20)
        programs = {"camera": start("camera", *small), "tracker": start("tracker")}
        wait_for_nodes(client, "camera_front", "tracker_front")
        reported = {("zenoh_vision_node_level", f"{name}_front") for name in programs}
        exporter.until(lambda found: reported <= set(found))
        yield System(router, client, programs, exporter)


@dataclass
class MadeUp:
    """A node that is only a token and what it says; ends with its session."""

    session: zenoh.Session
    name: str
    namespace: str = "vision"

    def __post_init__(self) -> None:
        key = f"@{self.namespace}/node/{self.name}"
        self.token = self.session.liveliness().declare_token(key)

    def say(self, payload: bytes | None = None, **changes: object) -> None:
        whole = msgpack.packb({**HEALTH, "node": self.name, **changes})
        self.put(payload or whole)

    def put(self, payload: bytes) -> None:
        key = f"@{self.namespace}/diagnostics/{self.name}"
        self.session.put(key, payload, congestion_control=KEPT)

    def is_heard(self, found: dict[tuple[str, ...], float]) -> bool:
        """Speak, and tell whether that is served: who has just come back may not listen yet."""
        self.say()
        return ("zenoh_vision_node_level", self.name) in found


def test_what_real_nodes_count_is_served_and_balances(system: System):
    def both(found: dict[tuple[str, ...], float]) -> bool:
        done = (("published", "camera_front"), ("processed", "tracker_front"))
        return all(
            found.get((f"zenoh_vision_frames_{n}_total", node), 0) > 10
            and found["zenoh_vision_node_report_age_seconds", node] < 5
            and found["zenoh_vision_frame_rate_hertz", node] > 0
            for n, node in done
        )

    def as_many_in_histogram(found: dict[tuple[str, ...], float]) -> bool:
        # The node reads the two one after the other, and a frame may end between.
        processed = found["zenoh_vision_frames_processed_total", "tracker_front"]
        in_histogram = found["zenoh_vision_frame_latency_seconds_count", "tracker_front"]
        return abs(in_histogram - processed) <= 1

    found = system.exporter.until(lambda found: both(found) and as_many_in_histogram(found))

    def total(name: str, node: str) -> float:
        return sum(v for key, v in found.items() if key[:2] == (f"zenoh_vision_{name}", node))

    for node, arrived, done in (
        ("camera_front", "captured", "published"),
        ("tracker_front", "received", "processed"),
    ):
        assert total(f"frames_{arrived}_total", node) == (
            total(f"frames_{done}_total", node)
            + total("frames_dropped_total", node)
            + total("frames_pending", node)
        )
        assert found["zenoh_vision_node_up", node] == 1
    assert found["zenoh_vision_router_up",] == 1


def test_a_killed_node_is_down_and_the_others_are_not(system: System):
    exporter = system.exporter
    system.programs["tracker"].process.kill()
    killed_s = time.monotonic()
    found = exporter.until(lambda f: f.get(("zenoh_vision_node_up", "tracker_front")) == 0)
    assert time.monotonic() - killed_s < GONE_S  # told by its token, not by its silence
    assert [key for key in found if "tracker_front" in key] == [
        ("zenoh_vision_node_up", "tracker_front")
    ]
    assert found["zenoh_vision_node_up", "camera_front"] == 1
    assert found["zenoh_vision_node_level", "camera_front"] >= 0


def test_a_node_of_anyone_is_served_and_is_down_when_it_leaves(system: System):
    with open_client(system.router.endpoint) as session:
        made_up = MadeUp(session, "brightness_front")
        made_up.say(level=2, counters={"received": 3, "dropped.dark": 1, "lamps": 2})
        found = system.exporter.until(
            lambda f: f.get(("zenoh_vision_node_level", "brightness_front")) == 2
        )
        assert found["zenoh_vision_frames_dropped_total", "brightness_front", "dark"] == 1
        assert found["zenoh_vision_other_total", "lamps", "brightness_front"] == 2
    system.exporter.until(lambda f: f.get(("zenoh_vision_node_up", "brightness_front")) == 0)


def test_nodes_that_were_there_before_are_up_and_those_of_other_namespaces_are_not_served(
    system: System, tmp_path: Path
):
    with open_client(system.router.endpoint) as session:
        silent = MadeUp(session, "silent", namespace="yard")
        arguments = ["metrics", "--listen", "127.0.0.1:0", "--namespace", "yard"]
        arguments += ["--connect", system.router.endpoint]
        with Program(arguments, tmp_path, "yard", forked=ZV) as yard:
            found = Exporter(yard).until(lambda f: ("zenoh_vision_node_up", silent.name) in f)
    assert {key: value for key, value in found.items() if "node" in key[0]} == {
        ("zenoh_vision_node_up", "silent"): 1
    }


def test_what_is_no_health_is_counted_and_logged_once_and_nothing_else(system: System):
    exporter = system.exporter
    with open_client(system.router.endpoint) as session:
        made_up = MadeUp(session, "bad")
        good = msgpack.packb(HEALTH | {"node": "bad"})
        junk = [b"", b"junk", good[:-1], good + b"\0", b"\x80" * 3, msgpack.packb([1])]
        for payload in junk:
            made_up.put(payload)
        session.delete("@vision/diagnostics/bad", congestion_control=KEPT)
        made_up.say(level=9)
        made_up.say(node="camera_front", level=3)
        made_up.say(counters={f"c{n}": n for n in range(200)})
        found = exporter.until(
            lambda f: (
                f.get(("zenoh_vision_exporter_messages_rejected_total", "too_many"))
                and ("zenoh_vision_node_level", "camera_front") in f
            )
        )
        rejected = "zenoh_vision_exporter_messages_rejected_total"
        assert found[rejected, "bad_message"] == len(junk) + 2
        assert found[rejected, "wrong_node"] == 1
        assert found["zenoh_vision_node_up", "bad"] == 1
        assert ("zenoh_vision_node_level", "bad") not in found
        assert found["zenoh_vision_node_level", "camera_front"] != 3
    complaints = exporter.program.complaints
    assert len(re.findall("dropped a sample, bad_message", complaints)) == 1
    assert "Traceback" not in complaints


def test_it_serves_before_there_is_a_router_and_through_its_death(tmp_path: Path):
    router = Router(tmp_path)
    arguments = ["metrics", "--listen", "127.0.0.1:0", "--connect", router.endpoint]
    try:
        with Program(arguments, tmp_path, "metrics", forked=ZV) as program:
            exporter = Exporter(program)
            assert exporter.value("router_up") == 0
            router.start()
            exporter.until(lambda found: found["zenoh_vision_router_up",] == 1)
            with open_client(router.endpoint) as session:
                made_up = MadeUp(session, "x")
                exporter.until(made_up.is_heard)
                router.kill()
                found = exporter.until(lambda found: found["zenoh_vision_router_up",] == 0)
                found = exporter.until(lambda f: f["zenoh_vision_node_up", "x"] == 0)
                assert ("zenoh_vision_node_level", "x") not in found
                router.start()
                exporter.until(lambda f: f["zenoh_vision_node_up", "x"] == 1)
                exporter.until(made_up.is_heard)
                assert exporter.value("router_up") == 1
            # A client that is connected and says nothing does not keep it from ending.
            port = int(exporter.url.rpartition(":")[2].partition("/")[0])
            with socket.create_connection(("127.0.0.1", port)):
                program.process.send_signal(signal.SIGTERM)
                assert program.process.wait(IDLE_S - 1.0) == 0
            assert "Traceback" not in program.complaints
    finally:
        router.close()


def test_without_a_router_it_waits_for_ever_without_a_time_out(tmp_path: Path):
    arguments = ["metrics", "--listen", "127.0.0.1:0"]
    nowhere = ["--connect", "tcp/127.0.0.1:1"]
    with (
        Program([*arguments, *nowhere, "--timeout", "0.3"], tmp_path, "told", forked=ZV) as told,
        Program([*arguments, *nowhere], tmp_path, "waiting", forked=ZV) as waiting,
    ):
        assert told.process.wait(START_S) == 4
        assert "within 0.3 s" in told.complaints
        assert Exporter(waiting).value("router_up") == 0
        assert waiting.interrupt() == 0
