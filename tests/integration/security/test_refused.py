"""Who is let in and who is not, what is said then, and what a revocation does to the others."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
import zenoh

from tests.integration.conftest import QUICK_ZV
from tests.support.fork_server import ZV
from tests.support.listening import living_nodes
from tests.support.processes import Program
from tests.support.routing import free_port
from tests.support.secured import Secured, embedded, official, secured
from tests.support.waiting import wait_until
from zenoh_vision.errors import RouterUnreachable
from zenoh_vision.messages import Diagnostics
from zenoh_vision.security.credentials import CERTIFICATE, KEY, credentials_file
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.link import Link
from zv.tools.security.authority import Issued, base64_of, issue
from zv.tools.security.folder import Folder

SAID_S = 5.0
"""Within this long a node says that something is denied."""


def said_in(health: Path) -> str:
    """Return what a node has written of its health: nothing before its first report."""
    try:
        return health.read_text()
    except FileNotFoundError:
        return ""


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Secured:
    return secured(tmp_path_factory.mktemp("refused"))


@pytest.fixture(scope="module", params=[official, embedded], ids=["zenohd", "embedded"])
def router(
    request: pytest.FixtureRequest, system: Secured, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Secured]:
    own = replace(system, port=system.port)
    with request.param(own, tmp_path_factory.mktemp("router")):
        yield own


def another(system: Secured, name: str, folder: Path, issued: Issued) -> Path:
    """Write credentials like somebody's, with another certificate."""
    content = system.content(name)
    tls = content["transport"]["link"]["tls"]
    tls[CERTIFICATE], tls[KEY] = base64_of(issued.certificate), base64_of(issued.key)
    file = folder / f"{name}.json5"
    file.touch(0o600)
    file.write_text(f"// changed\n{json.dumps(content)}")
    return file


def refused(system: Secured, file: Path | None, status: int = 2, **changes: object) -> str:
    """Try to connect; check the exit status, and return what is said about the refusal."""
    # A busy machine takes more than a second for the handshake that tells why.
    given = {"connect": system.endpoint, "timeout_s": 2.0, **changes}
    credentials = None if file is None else str(file)
    with pytest.raises(RouterUnreachable) as raised:
        Link(Connection(credentials=credentials, **given)).close()  # type: ignore[arg-type]
    assert raised.value.exit_status == status
    return str(raised.value)


def certificate(system: Secured, days: int, monkeypatch: pytest.MonkeyPatch) -> Issued:
    """Issue a certificate that begins in so many days, or has ended so many days ago."""
    from zv.tools.security import authority

    class Shifted(authority.datetime):
        @classmethod
        def now(cls, zone: object = None) -> object:
            return super().now(zone) + authority.timedelta(days=days)

    signer = Folder(str(system.folder)).authority()
    monkeypatch.setattr(authority, "datetime", Shifted)
    issued = issue(signer, "camera_front", (), 1)
    monkeypatch.undo()
    return issued


def test_one_with_a_certificate_is_let_in(router: Secured):
    with router.client("camera_front") as session:
        assert list(session.info.routers_zid())


def test_nobody_without_a_certificate_gets_in_and_it_is_said_what_is_needed(router: Secured):
    said = refused(router, None, connect=f"tcp/127.0.0.1:{router.port}")
    assert "it speaks TLS and asks for a certificate: give --credentials" in said


@pytest.mark.parametrize(
    ("days", "said"),
    [
        (-3, ("certificate of camera_front ended ", "dir {dir}, unless the clock is wrong")),
        (3, ("is valid from", "this machine's clock says", "set the clock")),
    ],
    ids=["ended", "of the future"],
)
def test_a_certificate_out_of_its_time_is_not_let_in(
    router: Secured, tmp_path, monkeypatch, days, said
):
    issued = certificate(router, days, monkeypatch)
    told = refused(router, another(router, "camera_front", tmp_path, issued))
    assert all(each.format(dir=tmp_path) in told for each in said)
    with pytest.raises(zenoh.ZError):
        raw_client(router, tmp_path / "camera_front.json5")


def raw_client(system: Secured, file: Path, timeout_ms: int = 400) -> None:
    """Connect as Zenoh itself does, without any check of ours."""
    config = zenoh.Config.from_file(str(file))
    for key, value in {
        "connect/endpoints": [system.endpoint],
        "connect/timeout_ms": timeout_ms,
    }.items():
        config.insert_json5(key, json.dumps(value))
    zenoh.open(config).close()


def test_a_file_of_credentials_is_a_configuration_that_any_zenoh_program_can_load(router: Secured):
    raw_client(router, router.file("camera_front"), timeout_ms=10_000)


def test_a_certificate_of_another_authority_is_not_let_in(router: Secured, tmp_path):
    other = secured(tmp_path)
    said = refused(router, other.file("camera_front"))
    assert "was issued by another authority than that of camera_front" in said
    # It does not help to know the right authority.
    foreign = other.content("camera_front")
    tls = foreign["transport"]["link"]["tls"]
    mixed = another(
        router, "camera_front", tmp_path, Issued(*(_pem(tls[part]) for part in (CERTIFICATE, KEY)))
    )
    with pytest.raises(zenoh.ZError):
        raw_client(router, mixed)


def _pem(text: str) -> bytes:
    import base64

    return base64.b64decode(text)


def test_a_router_under_another_name_is_not_spoken_to(router: Secured):
    said = refused(router, router.file("guest"), connect=f"tls/127.0.0.9:{router.port}")
    assert "its certificate does not name 127.0.0.9: zv security renew router --host" in said


def test_a_name_of_a_router_that_nobody_knows_is_named(system: Secured):
    unknown = "tls/no-such-router.invalid:7447"
    said = refused(system, system.file("guest"), connect=unknown, timeout_s=0.3)
    assert said.endswith(
        ": the name no-such-router.invalid is not known here; check its spelling, and the name "
        "server"
    )


def test_without_a_router_nothing_is_said_of_a_refusal(system: Secured):
    nobody = f"tls/127.0.0.1:{free_port()}"
    said = refused(system, system.file("guest"), 4, connect=nobody, timeout_s=0.3)
    assert "no Zenoh router at tls/127.0.0.1:" in said


# Revocation


@pytest.mark.quiet
def test_a_revoked_node_is_out_and_comes_back_under_another_number_and_the_others_go_on(tmp_path):
    system = secured(tmp_path)
    stolen = tmp_path / "camera_front.json5"
    said = "the router gives camera_front no rights: its certificate was revoked"
    with embedded(system, tmp_path) as router, watching(system) as seen:
        health = tmp_path / "health"
        with (
            service(system, "camera", tmp_path, ZV_HEALTH_FILE=str(health)) as camera,
            service(system, "tracker", tmp_path) as tracker,
        ):
            wait_until(lambda: seen() >= {"camera_front", "tracker_front"}, 20)
            stolen.touch(0o600)
            stolen.write_bytes(system.file("camera_front").read_bytes())
            begun_s = time.monotonic()
            system.revoke("camera_front")
            wait_until(
                lambda: seen() == {"tracker_front"},
                60,
                lambda: f"{seen()}: {router.complaints} {camera.complaints} {tracker.complaints}",
            )
            assert time.monotonic() - begun_s < 60
            wait_until(lambda: said in camera.complaints, 3 * SAID_S)
            wait_until(lambda: said in said_in(health), 3 * SAID_S)
            assert "took the new rules" in router.complaints
            # Given a new certificate while it runs, it comes back by itself.
            system.add(camera=("front",))
            wait_until(lambda: "denied no more" in camera.complaints, 30)
            wait_until(
                lambda: seen() == {"camera_front", "tracker_front"},
                20,
                lambda: f"{seen()}: {camera.complaints}",
            )
            assert tracker.process.poll() is None
        # The stolen one stays out.
        words = ["camera", "--credentials", stolen, "--connect", system.endpoint]
        with Program(words, tmp_path, "thief", forked=QUICK_ZV) as thief:
            wait_until(lambda: said in thief.complaints, 20)
            assert seen() == set()


@contextmanager
def watching(system: Secured) -> Iterator[Callable[[], set[str]]]:
    """Yield what returns the nodes whose tokens a guest sees."""
    with closing(Link(system.connection("guest"))) as link:
        yield lambda: {key.rpartition("/")[2] for key in living_nodes(link.session)}


def service(system: Secured, name: str, folder: Path, **variables: str) -> Program:
    """Start a service of the camera ``front`` with its own credentials, quick to check them."""
    words = [name, "--credentials", system.file(f"{name}_front"), "--connect", system.endpoint]
    words += ["--rate", "10"] if name == "camera" else []
    label = f"{name}{time.monotonic_ns()}"
    return Program(words, folder, label, forked=QUICK_ZV, **variables)


def test_rights_survive_a_restart_of_the_router(tmp_path):
    system = secured(tmp_path)
    arrived: list[str] = []
    for _ in range(2):
        with (
            embedded(system, tmp_path),
            system.client("guest") as guest,
            system.witness() as witness,
        ):
            witness.declare_subscriber(
                "vision/**", lambda sample: arrived.append(str(sample.key_expr))
            )
            guest.put("vision/front/centroid", b"forged")
            for each in (guest, witness):
                assert list(each.get("@/*/router", timeout=2.0))
    assert arrived == []


def test_a_router_keeps_its_rules_while_its_file_cannot_be_used(tmp_path):
    system = secured(tmp_path)
    with embedded(system, tmp_path) as router:
        whole = system.file("router").read_text()
        system.file("router").write_text(whole[: len(whole) // 2])
        wait_until(lambda: "the former rules hold" in router.complaints, 20)
        with system.client("guest") as guest:
            assert list(guest.info.routers_zid())
        system.file("router").write_text(f"{whole}\n")
        wait_until(lambda: "took the new rules" in router.complaints, 20)


def test_a_router_goes_on_with_its_former_rules_if_it_cannot_run_with_others(tmp_path):
    system = secured(tmp_path)
    other = secured(tmp_path / "other")
    health = tmp_path / "health"
    with embedded(system, tmp_path, ZV_HEALTH_FILE=str(health)) as router:
        content = system.content("router")
        tls, key = content["transport"]["link"]["tls"], "listen_private_key_base64"
        tls[key] = other.content("router")["transport"]["link"]["tls"][key]
        system.rewrite("router", content)
        wait_until(lambda: "the former rules hold: " in router.complaints, 20)
        assert f"zv security renew router --dir {system.folder} writes it again" in (
            router.complaints
        )
        wait_until(lambda: "the former rules hold: " in said_in(health), 10)
        with system.client("guest") as guest:
            assert list(guest.info.routers_zid())
        assert "took the new rules" not in router.complaints
        system.renew("router")
        wait_until(lambda: "took the new rules" in router.complaints, 20)
        wait_until(lambda: said_in(health) == "ok\n", 10)


# What is denied is said


DENIED = {
    "another camera": "camera --camera back | camera_front | publish vision/back/image/compressed",
    "another service": "tracker | edge_front | publish vision/front/centroid",
    "no input": "edge | camera_front | subscribe vision/front/image",
    "another namespace": "camera --namespace lab | camera_front | announce @lab/node/camera_front",
}
"""Nodes, each with somebody's credentials that deny it something. They run at the same time."""


def test_a_node_says_within_5_s_what_it_is_denied(router: Secured, tmp_path):
    with ExitStack() as running:
        nodes = {}
        for name, case in DENIED.items():
            words, credentials, denied = case.split(" | ")
            health = tmp_path / f"{name} health"
            given = [*words.split(), "--credentials", router.file(credentials)]
            given += ["--connect", router.endpoint]
            node = Program(given, tmp_path, name, forked=ZV, ZV_HEALTH_FILE=str(health))
            nodes[running.enter_context(node)] = health, credentials, denied
        connected_s: dict[Program, float] = {}
        denied_s: dict[Program, float] = {}

        def all_denied() -> bool:
            for node in nodes:
                if "connected to the router" in node.complaints:
                    connected_s.setdefault(node, time.monotonic())
                if "the router denies: " in node.complaints:
                    denied_s.setdefault(node, time.monotonic())
            return len(denied_s) == len(nodes)

        wait_until(all_denied, 50)
        for node, (health, credentials, denied) in nodes.items():
            assert denied_s[node] - connected_s[node] < SAID_S, node.name
            # Said again when the node has declared more since.
            line = [line for line in node.complaints.splitlines() if "the router denies" in line][
                -1
            ]
            assert denied in line or "more" in line
            assert f"no rule allows it to the certificate of {credentials}" in line
            assert f"--dir {router.folder}" in line
            wait_until(lambda health=health: "the router denies" in said_in(health), 5)


def test_a_certificate_that_ends_soon_is_warned_about_in_log_and_diagnostics(tmp_path):
    system = secured(tmp_path, days=10)
    with embedded(system, tmp_path), service(system, "camera", tmp_path) as camera:
        said = "the certificate of camera_front ends"
        wait_until(lambda: said in camera.complaints, 20)
        with system.client("guest") as guest:

            def warned() -> bool:
                replies = guest.get("@vision/diagnostics/camera_front", timeout=2.0)
                reports = [each.ok.payload.to_bytes() for each in replies if each.ok]
                return any(said.encode() in each for each in reports)

            wait_until(warned, 10)
            system.renew("camera_front", days=300)
            wait_until(lambda: not warned(), 10)
            system.file("camera_front").write_text("{")
            said = "the next connection will fail: "
            wait_until(warned, 10)
            assert "cut short or damaged; zv security renew camera_front" in camera.complaints
            system.renew("camera_front")


def test_a_node_judges_by_the_rights_that_its_file_has_now(tmp_path):
    system = secured(tmp_path)
    content = system.content("camera_front")
    rights = content["metadata"]["zenoh_vision"]["rights"]
    announce = rights.pop("announce")
    system.rewrite("camera_front", content)
    with embedded(system, tmp_path), service(system, "camera", tmp_path) as camera:
        wait_until(lambda: "denies: announce @vision/node/camera_front" in camera.complaints, 30)
        rights["announce"] = announce
        system.rewrite("camera_front", content)
        wait_until(lambda: "denied no more" in camera.complaints, 20)


def test_a_node_whose_certificate_has_ended_says_so_while_it_waits_and_comes_in_once_renewed(
    router: Secured, tmp_path, monkeypatch
):
    good = router.file("camera_front").read_bytes()
    file = another(router, "camera_front", tmp_path, certificate(router, -3, monkeypatch))
    health = tmp_path / "health"
    words = ["camera", "--credentials", file, "--connect", router.endpoint]
    with Program(words, tmp_path, "late", forked=ZV, ZV_HEALTH_FILE=str(health)) as camera:
        wait_until(lambda: "the certificate of camera_front ended" in camera.complaints, 20)
        wait_until(lambda: "trouble: the certificate" in said_in(health), 5)
        new = tmp_path / "new"
        new.touch(0o600)
        new.write_bytes(good)
        os.replace(new, file)
        wait_until(lambda: "connected to the router" in camera.complaints, 20)
        wait_until(lambda: said_in(health) == "ok\n", 10)


def test_nodes_that_share_memory_are_denied_nothing(tmp_path):
    system = secured(tmp_path)
    with (
        embedded(system, tmp_path),
        service(system, "camera", tmp_path) as camera,
        service(system, "edge", tmp_path) as edge,
        system.client("guest") as guest,
    ):

        def uptime_s() -> float:
            replies = guest.get("@vision/diagnostics/edge_front", timeout=2.0)
            payloads = [each.ok.payload.to_bytes() for each in replies if each.ok]
            return Diagnostics.from_bytes(payloads[0]).uptime_s if payloads else 0.0

        wait_until(lambda: uptime_s() > 3, 60)  # after two rounds of the check
        for node in (camera, edge):
            assert "denies" not in node.complaints


def test_nothing_secret_is_printed_logged_or_on_the_command_line(router: Secured, tmp_path):
    content = router.content("camera_front")
    secret = content["transport"]["link"]["tls"][KEY]
    words = ["camera", "--debug", "--credentials", router.file("camera_front")]
    words += ["--connect", router.endpoint]
    with Program(words, tmp_path, "node", forked=ZV) as node, router.client("operator") as operator:
        wait_until(lambda: "connected to the router" in node.complaints, 30)
        everything = ["vision/**", "@vision/node/*", "@vision/param/**", "@/*/router/**"]
        shown = b""
        for key in everything:
            for reply in operator.get(key, timeout=2.0):
                shown += reply.ok.payload.to_bytes() if reply.ok else reply.err.payload.to_bytes()
        command = Path(f"/proc/{node.process.pid}/cmdline").read_bytes()
    assert secret not in node.complaints + node.output
    assert secret.encode() not in shown + command
    repr_of = repr(credentials_file(str(router.folder / "camera_front")))
    assert secret not in repr_of
