"""zv doctor on the router: whether it is there, its version, shared memory; and without one."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import zenoh

from tests.integration.conftest import a_router
from tests.support.diagnosing import GOOD_FILE, Diagnosis
from tests.support.listening import open_client
from tests.support.routing import free_port
from tests.support.standing_in import StandIn
from tests.support.typist import zv
from tests.support.waiting import DEADLINE_S
from zenoh_vision.errors import RouterUnreachable


@contextmanager
def plain_router(*, adminspace: bool, shared_memory: bool) -> Iterator[str]:
    """Yield the endpoint of a router as Zenoh makes it, not this project."""
    config = zenoh.Config()
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    for key, value in {
        "mode": "router",
        "listen/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,
        "adminspace/enabled": adminspace,
        "transport/shared_memory/enabled": shared_memory,
    }.items():
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config):
        yield endpoint


def test_shared_memory_left_on_is_found_with_whose_session_it_is():
    with plain_router(adminspace=True, shared_memory=True) as endpoint:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        with zenoh.open(config) as session:  # Zenoh's default: shared memory is on
            camera = StandIn(session, "camera_front")
            seen = Diagnosis(endpoint, "vision")
            del camera
    ((level, text, remedy),) = seen.of("memory")
    said = "Zenoh's own shared memory is on between the router and camera_front"
    assert (level, text) == ("WARN", said)
    assert "shared_memory: { enabled: false }" in remedy


def test_of_a_router_that_does_not_answer_the_version_is_unknown_and_namespaces_are_found():
    with (
        plain_router(adminspace=False, shared_memory=False) as endpoint,
        open_client(endpoint) as session,
    ):
        camera = StandIn(session, "camera_front", namespace="roof")
        with session.declare_queryable("roof/front/centroid", answer_anything):
            seen = Diagnosis(endpoint, "rof")
        del camera
    ((level, text, remedy),) = seen.of("router")
    assert level == "OK"
    assert "version unknown" in text
    assert "adminspace" in remedy
    assert "roof: camera_front" in seen.of("namespace")[0][1]


def answer_anything(query: zenoh.Query) -> None:
    with query:
        query.reply("roof/front/centroid", b"")


def test_a_router_of_another_version_is_reported(shared, monkeypatch):
    monkeypatch.setattr("zv.tools.doctor.network.installed", lambda _: "1.4.0")
    ((level, text, _),) = Diagnosis(shared.endpoint, "nobody_at_all").of("router")
    assert level == "WARN"
    assert "but eclipse-zenoh 1.4.0 here" in text


def test_a_router_that_dies_meanwhile_fails(tmp_path):
    asked = threading.Event()

    def counters(_: float) -> dict[str, int]:
        asked.set()
        return {"received": 0, "processed": 0}

    with a_router(tmp_path) as router, open_client(router.endpoint) as session:
        node = StandIn(session, "tracker_front", counters=counters)

        def kill_while_it_looks() -> None:
            asked.wait(DEADLINE_S)
            router.kill()

        killing = threading.Thread(target=kill_while_it_looks)
        killing.start()
        seen = Diagnosis(router.endpoint, "vision", for_s=2.0)
        killing.join()
        del node
    ((level, text, _),) = seen.of("router")
    assert level == "FAIL"
    assert "was lost" in text


def test_without_a_router_the_rest_is_checked_and_the_status_is_4():
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    seen = Diagnosis(endpoint, "vision", timeout_s=1.0)
    assert [f["check"] for f in seen.found] == ["files", "devices", "router"]
    ((level, text, remedy),) = seen.of("router")
    assert level == "FAIL"
    assert endpoint in text
    assert "zv router" in remedy
    assert isinstance(seen.error, RouterUnreachable)


def test_planted_faults_stand_in_lines_with_file_key_and_what_is_allowed(tmp_path):
    (tmp_path / "camera.toml").write_text("qualty = 50\n")
    (tmp_path / "edge-front.toml").write_text('aperture = "wide"\n')
    (tmp_path / "z.json5").write_text("{ mode: 'router' }")
    files = [str(tmp_path / name) for name in ("camera.toml", "edge-front.toml", "z.json5")]
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    done = zv(endpoint, "doctor", *files, "--timeout", "0.5")
    assert done.returncode == 1  # not only the router failed
    lines = done.stdout.splitlines()
    assert [line.split()[:2] for line in lines] == [
        ["FAIL", "files"],
        ["FAIL", "files"],
        ["WARN", "memory"],
        ["OK", "devices"],
        ["FAIL", "router"],
    ]
    assert all(text in lines[0] for text in (files[0], "'qualty'", "did you mean 'quality'"))
    assert all(text in lines[1] for text in (files[1], "aperture = 'wide'", "one of 3, 5, 7"))
    assert files[2] in lines[2]
    assert done.stderr == "zv: 1 OK, 1 WARN, 3 FAIL\n"


def test_a_zenoh_file_that_is_wrong_is_a_line_and_no_end(tmp_path):
    file = tmp_path / "client.json5"
    file.write_text("{ mode: 'kraken' }")
    flags = ("--zenoh-config", str(file), "--json")
    done = zv("tcp/127.0.0.1:1", "doctor", GOOD_FILE, *flags)
    found = {f["check"]: f for f in map(json.loads, done.stdout.splitlines())}
    assert done.returncode == 1
    assert found["router"]["level"] == "FAIL"
    assert str(file) in found["router"]["text"]
    assert "Traceback" not in done.stderr
