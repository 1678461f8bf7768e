"""zv doctor finds each of the conditions that docs/doctor.md lists, made with real processes."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import zenoh

from common.connection import Connection
from common.errors import ExpectationNotMet, RouterUnreachable, VisionError
from services.tools.doctor.command import run
from services.tools.doctor.options import DoctorOptions
from services.tools.output import Output
from tests.integration.conftest import Service, a_router, some_services
from tests.integration.listening import ask, newest, open_client
from tests.integration.publishing import PlainCamera
from tests.integration.routing import Router, free_port
from tests.integration.standing_in import DAY_S, StandIn
from tests.integration.typing_zv import zv
from tests.integration.waiting import wait_until
from tests.processes import ROOT, Program

SMALL = ("--width", 160, "--height", 120)
GOOD_FILE = str(ROOT / "configs" / "edge.toml")

Stand = Callable[..., StandIn]


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Router]:
    """One router; each test has a namespace of its own at it."""
    with a_router(tmp_path_factory.mktemp("router")) as router:
        yield router


@pytest.fixture
def start(shared: Router, tmp_path: Path) -> Iterator[Service]:
    with some_services(shared.endpoint, tmp_path) as start:
        yield start


@pytest.fixture
def stand(shared: Router) -> Iterator[Stand]:
    """Starts stand-ins, each with a session of its own."""
    standing = []
    with ExitStack() as open_sessions:

        def stand(node: str, **about: Any) -> StandIn:
            session = open_sessions.enter_context(open_client(shared.endpoint))
            standing.append(StandIn(session, node, **about))
            return standing[-1]

        yield stand


class Kept(Output):
    """Keeps what would be printed."""

    def __init__(self) -> None:
        super().__init__(as_json=True)
        self.records: list[Mapping[str, Any]] = []

    def record(self, fields: Mapping[str, Any]) -> None:
        self.records.append(fields)

    def note(self, text: str) -> None:
        """Say nothing."""


class Diagnosis:
    """What the doctor says of a namespace."""

    def __init__(self, endpoint: str, namespace: str, *files: str, for_s: float = 1.3) -> None:
        output = Kept()
        self.error: VisionError | None = None
        options = DoctorOptions(files=files or (GOOD_FILE,), for_=for_s)
        try:
            run(options, Connection(endpoint, namespace, timeout_s=1.0), output)
        except VisionError as error:
            self.error = error
        self.found = output.records

    def of(self, check: str) -> list[tuple[str, str, str]]:
        """Return level, text and remedy of a check's lines."""
        return [(f["level"], f["text"], f["remedy"]) for f in self.found if f["check"] == check]

    @property
    def troubles(self) -> set[tuple[str, str]]:
        """Level and check of all that is not OK."""
        return {(f["level"], f["check"]) for f in self.found if f["level"] != "OK"}


def levels(session: zenoh.Session, namespace: str, node: str) -> list[int]:
    return [each.body["level"] for each in ask(session, f"@{namespace}/diagnostics/{node}")]


def test_of_a_system_that_is_well_every_line_is_ok_and_the_status_is_0(shared, start):
    start("camera", "--namespace", "well", *SMALL, "--rate", 10)
    start("tracker", "--namespace", "well")
    with open_client(shared.endpoint) as session:
        newest(session, "well/front/centroid")
        reports = [newest(session, f"@well/diagnostics/{n}_front") for n in ("camera", "tracker")]
    assert all(report.body["level"] == 0 for report in reports)
    seen = Diagnosis(shared.endpoint, "well", for_s=3.0)
    assert (seen.error, seen.troubles) == (None, set()), seen.found
    assert [f["check"] for f in seen.found] == [
        *("files", "devices", "router", "memory", "namespace", "names", "answers", "versions"),
        *("clocks", "cameras", "drops", "speed", "health"),
    ]
    assert seen.of("router") == [
        ("OK", f"zenoh {version('eclipse-zenoh')} at {shared.endpoint}", ""),
    ]
    ((_, rate, _),) = seen.of("cameras")
    assert rate.startswith("camera_front: ")
    assert rate.endswith(" Hz, 10 Hz expected")


def test_two_nodes_of_one_name_are_found_with_their_processes(shared, start):
    twins = [start("camera", "--namespace", "twins", *SMALL, "--rate", 5) for _ in range(2)]
    with open_client(shared.endpoint) as session:
        wait_until(lambda: len(every_answer(session, "@twins/node/camera_front")) == 2)
    seen = Diagnosis(shared.endpoint, "twins")
    ((level, text, remedy),) = seen.of("names")
    assert level == "FAIL"
    assert text.startswith("2 nodes are called camera_front")
    assert all(f"pid {twin.process.pid} on " in text for twin in twins)
    assert "--camera" in remedy
    assert isinstance(seen.error, ExpectationNotMet)


def every_answer(session: zenoh.Session, key: str) -> list[zenoh.Reply]:
    every = {"target": zenoh.QueryTarget.ALL, "consolidation": zenoh.ConsolidationMode.NONE}
    return list(session.get(key, timeout=2.0, **every))


def test_versions_that_differ_are_named_with_who_has_them(shared, stand):
    stand("camera_front", namespace="versions", version="0.0.7")
    stand("tracker_front", namespace="versions", version="0.1.0")
    seen = Diagnosis(shared.endpoint, "versions")
    ((level, text, _),) = seen.of("versions")
    assert level == "WARN"
    assert "0.0.7: camera_front; 0.1.0: this zv, tracker_front" in text


def test_a_clock_that_is_apart_is_measured_by_round_trips(shared, stand):
    stand("camera_front", namespace="clocks", clock_ahead_s=-2.5)
    stand("tracker_front", namespace="clocks", host="here")
    seen = Diagnosis(shared.endpoint, "clocks")
    ((level, text, remedy),) = seen.of("clocks")
    assert level == "WARN"
    assert text.startswith("the clock of elsewhere (camera_front) is -2.")
    measured_s = float(text.partition(" is ")[2].partition(" s ")[0])
    assert measured_s == pytest.approx(-2.5, abs=0.05)
    assert "NTP" in remedy


def test_a_clock_a_day_ahead_fails_since_its_frames_are_refused(shared, stand):
    stand("camera_front", namespace="tomorrow", clock_ahead_s=DAY_S + 60)
    ((level, text, _),) = Diagnosis(shared.endpoint, "tomorrow").of("clocks")
    assert level == "FAIL"
    assert "refused" in text


def test_a_camera_that_lost_its_source_fails_with_what_it_says(shared, start):
    faults = ("--faults", "stall@3+100000", "--stall-after", 0.3, "--reopen-min", 60)
    start("camera", "--namespace", "lost", *SMALL, *faults)
    with open_client(shared.endpoint) as session:
        wait_until(lambda: levels(session, "lost", "camera_front") == [2], 15)
    seen = Diagnosis(shared.endpoint, "lost")
    ((level, text, _),) = seen.of("cameras")
    assert level == "FAIL"
    assert text.startswith("camera_front: no picture for 0.3 s; opening synthetic again")
    assert ("FAIL", "health") not in seen.troubles  # it is said once
    assert isinstance(seen.error, ExpectationNotMet)


def test_a_camera_without_pictures_fails_before_it_says_so_itself(shared, start):
    faults = ("--faults", "stall@3+100000", "--stall-after", 3000)
    start("camera", "--namespace", "dark", *SMALL, *faults)
    with open_client(shared.endpoint) as session:
        newest(session, "dark/front/image/compressed")
        newest(session, "@dark/diagnostics/camera_front")
    seen = Diagnosis(shared.endpoint, "dark", for_s=2.2)
    ((level, text, _),) = seen.of("cameras")
    assert level == "FAIL"
    assert text.startswith("camera_front: no picture in ")


def test_a_camera_under_its_rate_is_found_with_both_rates_and_the_parameter(shared, start):
    every_other = ",".join(f"drop@{2 * n + 1}+1" for n in range(80))
    start("camera", "--namespace", "slow_camera", *SMALL, "--rate", 10, "--faults", every_other)
    with open_client(shared.endpoint) as session:
        newest(session, "@slow_camera/diagnostics/camera_front")
    seen = Diagnosis(shared.endpoint, "slow_camera", for_s=3.0)
    ((level, text, remedy),) = seen.of("cameras")
    assert level == "WARN"
    assert text.endswith(" Hz of the 10 Hz it should have")
    rate_hz = float(text.removeprefix("camera_front: ").partition(" ")[0])
    assert 3 < rate_hz <= 6
    asked_hz = float(remedy.rpartition("zv param set camera_front rate=")[2])
    assert asked_hz == pytest.approx(rate_hz, abs=0.06)  # which was rounded


def test_the_expected_rate_may_come_from_the_parameter(shared, stand):
    stand(
        "camera_front",
        namespace="by_parameter",
        counters=lambda s: {"captured": int(12 * s), "published": int(12 * s)},
        parameters={"rate": {"value": 30.0}},
    )
    ((level, text, remedy),) = Diagnosis(shared.endpoint, "by_parameter", for_s=2.2).of("cameras")
    assert (level, text) == ("WARN", "camera_front: 12.0 Hz of the 30 Hz it should have")
    assert "zv param set camera_front rate=12" in remedy


def test_a_system_without_a_camera_is_told_so(shared, stand):
    stand("tracker_front", namespace="blind")
    seen = Diagnosis(shared.endpoint, "blind")
    assert seen.of("cameras") == [
        ("WARN", "there is no camera", "zv camera --source synthetic"),
    ]
    assert seen.error is None  # a warning is no failure


def test_frames_that_a_real_tracker_drops_are_named_by_reason(shared, start):
    start("tracker", "--namespace", "broken")
    with open_client(shared.endpoint) as session:
        camera = PlainCamera(session, key="broken/front/image/compressed")

        def send() -> None:
            camera.send()
            if camera.seq % 5 == 0:
                camera.put(b"\xff\xd8 no picture", b"\x80")

        with camera.at(25, send):
            newest(session, "broken/front/centroid")
            newest(session, "@broken/diagnostics/tracker_front")
            seen = Diagnosis(shared.endpoint, "broken", for_s=2.2)
    ((level, text, remedy),) = (line for line in seen.of("drops") if "not_an_image" in line[1])
    assert level == "WARN"
    assert text.startswith("tracker_front loses ")
    assert " % of its frames as not_an_image (" in text
    share = float(text.removeprefix("tracker_front loses ").partition(" ")[0])
    assert share == pytest.approx(100 / 6, abs=5)
    assert "zv topic info broken/front/image/compressed" in remedy


@pytest.mark.parametrize(
    ("reason", "command"),
    {
        "stale": "zv param set tracker_front max_age=0.8",
        "missed": "zv param set camera_front quality=60",
    }.items(),
    ids=["stale", "missed"],
)
def test_a_loss_is_mended_by_the_parameter_of_who_can(shared, stand, reason, command):
    name = reason if reason == "missed" else f"dropped.{reason}"
    key = f"{reason}/front/image/compressed"
    stand(
        "camera_front",
        namespace=reason,
        publishes=[key],
        parameters={"quality": {"value": 80, "type": "int", "minimum": 1.0, "maximum": 100.0}},
        counters=lambda s: {"captured": int(30 * s), "published": int(30 * s)},
    )
    stand(
        "tracker_front",
        namespace=reason,
        subscribes=[key],
        parameters={"max_age": {"value": 0.4, "maximum": 60.0}},
        counters=lambda s: {"received": int(30 * s), "processed": int(27 * s), name: int(3 * s)},
    )
    ((level, text, remedy),) = Diagnosis(shared.endpoint, reason).of("drops")
    assert level == "WARN"
    assert f" % of its frames as {reason} (" in text
    assert remedy.endswith(command)


def test_frames_that_the_camera_itself_lost_are_not_blamed_on_the_way(shared, stand):
    key = "upstream/front/image/compressed"
    for node, about in {
        "camera_front": {
            "publishes": [key],
            "counters": lambda s: {"captured": int(30 * s), "dropped.overwritten": int(2 * s)},
        },
        "tracker_front": {
            "subscribes": [key],
            "counters": lambda s: {"received": int(28 * s), "missed": int(2 * s)},
        },
    }.items():
        stand(node, namespace="upstream", **about)
    ((_, text, _),) = Diagnosis(shared.endpoint, "upstream", for_s=2.2).of("drops")
    assert text.startswith("camera_front loses 6.7 % of its frames as overwritten")


def test_a_small_loss_that_lasts_is_found_by_the_totals_and_one_that_is_over_is_not(shared, stand):
    for node, now in (("edge_front", 1), ("tracker_front", 0)):
        stand(
            node,
            namespace="seldom",
            counters=lambda s, now=now: {
                "received": 2000 + int(30 * s),
                "processed": 1960,
                "dropped.stale": 40 + now * int(s),
            },
        )
    ((level, text, _),) = Diagnosis(shared.endpoint, "seldom").of("drops")
    assert level == "WARN"
    assert text.startswith("edge_front loses 2.0 % of its frames as stale (4")
    assert "since its start" in text


def test_a_real_node_slower_than_its_stream_is_found_with_the_parameter(shared, start, tmp_path):
    start("camera", "--namespace", "slow", *SMALL, "--rate", 30)
    script = ["-m", "tests.integration.slow_consumer", shared.endpoint, "slow"]
    with Program(script, tmp_path, "slow"), open_client(shared.endpoint) as session:
        report = wait_until(
            lambda: (
                (found := ask(session, "@slow/diagnostics/slow_front"))
                and found[0].body["counters"].get("dropped.overwritten", 0) > 10
            ),
            20,
        )
        assert report
        seen = Diagnosis(shared.endpoint, "slow", for_s=2.2)
    ((level, text, remedy),) = seen.of("speed")
    assert level == "WARN"
    assert text.startswith("slow_front uses ")
    assert text.endswith(" Hz that come on slow/front/image/compressed")
    used, came = (float(text.split()[at]) for at in (2, 4))
    assert used < 12
    assert came > 2 * used
    asked_hz = float(remedy.rpartition("zv param set camera_front rate=")[2])
    assert asked_hz == pytest.approx(30 * used / came, rel=0.02)
    assert not [text for _, text, _ in seen.of("drops") if "overwritten" in text]  # said once


def test_a_namespace_typed_wrong_fails_and_names_what_there_is(shared, start):
    start("tracker", "--namespace", "greenhouse")
    with open_client(shared.endpoint) as session:
        newest(session, "@greenhouse/node/tracker_front")
    seen = Diagnosis(shared.endpoint, "grenhouse")
    ((level, text, remedy),) = seen.of("namespace")
    assert level == "FAIL"
    assert "no node in namespace grenhouse" in text
    assert "greenhouse: tracker_front" in text
    assert remedy == "--namespace greenhouse, or ZV_NAMESPACE=greenhouse"
    assert isinstance(seen.error, ExpectationNotMet)


def test_a_tracker_of_a_camera_that_is_not_there_is_told_which_are(shared, start, stand):
    stand("camera_front", namespace="wrong_camera")
    start("tracker", "--namespace", "wrong_camera", "--camera", "font")
    with open_client(shared.endpoint) as session:
        wait_until(lambda: levels(session, "wrong_camera", "tracker_font") == [3], 15)
    seen = Diagnosis(shared.endpoint, "wrong_camera")
    ((level, text, remedy),) = seen.of("health")
    assert level == "WARN"
    assert text.startswith("tracker_font: no frame on wrong_camera/font/image/compressed")
    assert "cameras here: front" in remedy


def test_what_a_node_complains_of_otherwise_is_passed_on(shared, stand):
    stand("own_front", namespace="pain", health={"level": 2, "message": "the disk is full"})
    seen = Diagnosis(shared.endpoint, "pain")
    assert ("FAIL", "own_front: the disk is full", "see its log") in seen.of("health")


def test_what_a_node_says_does_not_steer_the_terminal(shared, stand):
    stand("own_front", namespace="evil", health={"level": 2, "message": "\x1b[2Jall is well"})
    done = zv(shared.endpoint, "doctor", GOOD_FILE, "--namespace", "evil", "--for", "1.2s")
    assert done.returncode == 1
    assert "\\x1b[2Jall is well" in done.stdout
    assert "\x1b" not in done.stdout


def test_a_node_that_shows_its_token_and_does_not_answer_fails(shared, stand):
    stand("camera_front", namespace="frozen", answers=False)
    seen = Diagnosis(shared.endpoint, "frozen")
    ((level, text, _),) = seen.of("answers")
    assert (level, text) == ("FAIL", "camera_front shows its token but does not answer")


def test_a_node_that_reports_no_health_any_more_fails(shared, stand):
    stand("tracker_front", namespace="mute", health={"stamp_ns": time.time_ns() - 9_000_000_000})
    ((level, text, _),) = Diagnosis(shared.endpoint, "mute").of("answers")
    assert level == "FAIL"
    assert text.startswith("tracker_front has not reported its health for ")


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
    assert (level, text) == ("WARN", "shared memory is on between the router and camera_front")
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


def test_a_router_of_another_version_is_told(shared, monkeypatch):
    monkeypatch.setattr("services.tools.doctor.router.installed", lambda _: "1.4.0")
    ((level, text, _),) = Diagnosis(shared.endpoint, "nobody_at_all").of("router")
    assert level == "WARN"
    assert "here is eclipse-zenoh 1.4.0" in text


def test_a_router_that_dies_meanwhile_fails(tmp_path):
    with a_router(tmp_path) as router:
        killing = threading.Timer(0.5, router.kill)
        killing.start()
        seen = Diagnosis(router.endpoint, "vision", for_s=2.0)
        killing.join()
    ((level, text, _),) = seen.of("router")
    assert level == "FAIL"
    assert "went away" in text


# Without a router


def test_without_a_router_the_rest_is_checked_and_the_status_is_4():
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    seen = Diagnosis(endpoint, "vision")
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
