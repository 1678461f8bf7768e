"""``zv security``: what it writes, what it refuses, and that nothing in use is lost."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import stat
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import datetime, tzinfo
from pathlib import Path

import pytest
import zenoh
from cryptography import x509

from tests.support.secured import Secured, quietly, secured
from tests.support.typist import type_zv
from tests.support.waiting import wait_until
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, SourceError
from zenoh_vision.security.credentials import (
    CERTIFICATE,
    DAY_S,
    KEY,
    ROUTER_FILE,
    read_credentials,
    read_json5,
    shown_time,
)
from zenoh_vision.transport.connection import Connection
from zv.registry import SERVICES
from zv.tools.security import authority as authority_module
from zv.tools.security import commands, showing
from zv.tools.security.folder import Folder
from zv.tools.security.options import (
    AddOptions,
    CheckOptions,
    InitOptions,
    ShowOptions,
    WebOptions,
)
from zv.tools.security.roles import rights_of
from zv.tools.security.web import web
from zv.tools.shared.output import Output


@pytest.fixture
def system(tmp_path: Path) -> Secured:
    return secured(tmp_path, camera=("front", "back"))


def check(system: Secured, node: str, key: str, action: str) -> str:
    options = CheckOptions(dir=str(system.folder), node=node, key=key, action=action)  # type: ignore[arg-type]
    return quietly(showing.check, options)


def modes(folder: Path) -> dict[str, int]:
    files = (each for each in folder.rglob("*") if each.is_file())
    return {each.name: stat.S_IMODE(each.stat().st_mode) for each in files}


def test_each_node_user_and_router_gets_one_file_that_only_its_owner_reads(system: Secured):
    names = {"router", "viewer", "recorder", "operator", "guest", "launcher"}
    for camera in ("front", "back"):
        names |= {f"{service}_{camera}" for service in ("camera", "tracker", "edge")}
    found = modes(system.folder)
    assert names <= {name.removesuffix(".json5") for name in found if name.endswith(".json5")}
    private = {name for name, mode in found.items() if mode == 0o600}
    public = {"ca.pem", "security.json", "compose.env"}
    assert private == found.keys() - public
    for name in public:
        assert "PRIVATE" not in (system.folder / name).read_text()


def during_init(folder: Path, command: Callable[[], None], monkeypatch) -> BaseException | None:
    """Run a command while ``init`` writes a folder; return the error with which it ends."""
    begun, waits = threading.Event(), threading.Event()
    flock, new_authority = fcntl.flock, commands.new_authority
    started: list[Future[None]] = []

    def noted(number: int, operation: int) -> None:
        if begun.is_set():
            waits.set()
        flock(number, operation)

    def interrupted(namespace: str) -> object:
        if not begun.is_set():
            begun.set()
            started.append(pool.submit(command))
            wait_until(lambda: waits.is_set() or started[0].done())
        return new_authority(namespace)

    monkeypatch.setattr(fcntl, "flock", noted)
    monkeypatch.setattr(commands, "new_authority", interrupted)
    with ThreadPoolExecutor(1) as pool:
        commands.init(InitOptions(folder=str(folder)), Connection(), Output())
    return started[0].exception()


def test_of_two_inits_at_once_in_one_folder_only_one_writes(tmp_path, monkeypatch):
    given = InitOptions(folder=str(tmp_path)), Connection(), Output()
    refused = during_init(tmp_path, lambda: commands.init(*given), monkeypatch)
    assert "has the certificates of a system already" in str(refused)


def test_an_add_during_init_waits_for_its_end(tmp_path, monkeypatch):
    given = AddOptions(dir=str(tmp_path), operator=("ann",)), Connection(), Output()
    assert during_init(tmp_path, lambda: commands.add(*given), monkeypatch) is None
    assert Folder(str(tmp_path)).file_of("ann").is_file()


def test_a_router_keeps_little_for_slow_links_and_enough_for_tls_to_go_on(system: Secured):
    (endpoint,) = system.content("router")["listen"]["endpoints"]
    assert endpoint.endswith("#so_sndbuf=65536")


def test_every_file_is_a_configuration_of_zenoh(system: Secured):
    for file in system.folder.rglob("*.json5"):
        zenoh.Config.from_file(str(file))


def test_the_router_denies_by_default_and_accepts_only_tls_with_certificates(system: Secured):
    content = system.content("router")
    assert content["access_control"]["default_permission"] == "deny"
    assert content["access_control"]["enabled"] is True
    tls = content["transport"]["link"]
    assert (tls["protocols"], tls["tls"]["enable_mtls"]) == (["tls"], True)
    assert content["adminspace"]["permissions"]["write"] is False
    kinds = {kind for rule in content["access_control"]["rules"] for kind in rule["messages"]
             if not rule["id"].startswith("routers")}  # fmt: skip
    assert "delete" not in kinds


def test_a_name_that_no_certificate_can_have_is_refused_before_anything_is_written(
    system: Secured, tmp_path: Path
):
    long = "c" * 60
    with pytest.raises(ConfigurationError, match=rf"camera_{long} is too long .*; allowed: 60"):
        secured(tmp_path / "other", camera=(long,))
    assert not (tmp_path / "other").exists()
    with pytest.raises(ConfigurationError, match=rf"{long}c is too long for a certificate"):
        system.add(operator=(f"{long}c",))


def test_a_namespace_may_be_longer_than_a_name_in_a_certificate(tmp_path: Path):
    folder = str(tmp_path / "security")
    quietly(commands.init, InitOptions(folder=folder), "n" * 64)
    assert Folder(folder).system().namespace == "n" * 64


def test_what_is_no_folder_is_said_so(tmp_path: Path):
    (tmp_path / "file").touch()
    system = Secured(tmp_path / "file", 1)
    with pytest.raises(SourceError, match=r"file/ca\.pem: Not a directory"):
        system.add(camera=("left",))
    with pytest.raises(SourceError, match=r"file/security\.json: Not a directory"):
        quietly(showing.show, ShowOptions(dir=str(system.folder)))


def test_nothing_is_overwritten(system: Secured):
    before = system.file("camera_front").read_bytes()
    with pytest.raises(ConfigurationError, match="nothing is overwritten; zv security add"):
        system.init()
    with pytest.raises(ConfigurationError, match=r"camera_back, .* have certificates already"):
        system.add(camera=("back",))
    assert system.file("camera_front").read_bytes() == before


def test_a_camera_that_is_added_gets_what_is_missing(system: Secured):
    system.revoke("edge_back")
    before = system.file("camera_back").read_bytes()
    system.add(camera=("back",))
    assert system.file("edge_back").exists()
    assert system.file("camera_back").read_bytes() == before


def test_check_names_the_rule_or_says_what_is_allowed_instead(system: Secured):
    said = check(system, "camera_front", "vision/front/image/compressed", "publish")
    assert said == ("allowed: rule 'camera_front: publish' allows vision/front/image/compressed\n")
    said = check(system, "operator", "@vision/set/camera_front", "query")
    assert "rule 'operator: query' allows @vision/set/*/**" in said
    with pytest.raises(ExpectationNotMet) as raised:
        check(system, "camera_front", "vision/back/image/compressed", "publish")
    assert str(raised.value).startswith(
        "denied: no rule allows camera_front to publish vision/back/image/compressed; it may "
        "publish vision/front/image/compressed, vision/front/image, "
    )
    with pytest.raises(ExpectationNotMet, match="no rule allows guest to query @vision"):
        check(system, "guest", "@vision/set/camera_front/quality", "query")
    with pytest.raises(ConfigurationError, match="did you mean 'camera_front'"):
        check(system, "camera_fron", "vision/front/image", "publish")


def test_check_judges_by_the_file_of_the_router_and_not_by_what_it_should_be(system: Secured):
    content = system.content("router")
    for rule in content["access_control"]["rules"]:
        if rule["id"] == "camera_front: publish":
            rule["key_exprs"] = ["vision/front/other"]
    system.rewrite("router", content)
    with pytest.raises(ExpectationNotMet, match="it may publish vision/front/other"):
        check(system, "camera_front", "vision/front/image/compressed", "publish")


def test_an_operator_stops_and_starts_nodes_of_zv_up_which_answers_and_nobody_else_does(
    system: Secured,
):
    key = "@vision/launch/camera_front"
    assert "rule 'operator: query' allows @vision/launch/*" in check(
        system, "operator", key, "query"
    )
    assert "allowed" in check(system, "launcher", key, "answer")
    for name, action in (("guest", "query"), ("viewer", "query"), ("operator", "answer")):
        with pytest.raises(ExpectationNotMet, match=f"no rule allows {name}"):
            check(system, name, key, action)


def test_a_service_of_ones_own_has_exactly_the_keys_that_are_given(system: Secured):
    system.add(node="sum", publishes=("vision/front/sum",), subscribes=("vision/*/centroid",))
    assert "allowed" in check(system, "sum", "vision/front/sum", "publish")
    assert "allowed" in check(system, "sum", "vision/back/centroid", "subscribe")
    for key, action in (("vision/front/centroid", "publish"), ("vision/front/tracks", "subscribe")):
        with pytest.raises(ExpectationNotMet):
            check(system, "sum", key, action)


def test_a_service_of_ones_own_may_be_described_by_itself(system: Secured, tmp_path):
    about = {
        "node": "sum", "service": "sum", "cameras": [], "version": "1", "host": "h", "pid": 1,
        "started_ns": 1, "publishes": ["vision/front/sum", "@vision/diagnostics/sum"],
        "subscribes": ["vision/front/tracks"],
    }  # fmt: skip
    (tmp_path / "sum.json").write_text(json.dumps(about))
    system.add(node="sum", description=str(tmp_path / "sum.json"))
    assert "allowed" in check(system, "sum", "vision/front/sum", "publish")
    assert "allowed" in check(system, "sum", "vision/front/tracks", "subscribe")
    (tmp_path / "bad.json").write_text("[1]")
    with pytest.raises(ConfigurationError, match="no description of a node"):
        system.add(node="other", description=str(tmp_path / "bad.json"))


def test_a_tracker_of_several_cameras_has_the_keys_of_these(system: Secured):
    system.add(node="tracker", camera=("front", "back"))
    for camera in ("front", "back"):
        assert "allowed" in check(system, "tracker", f"vision/{camera}/tracks", "publish")
    with pytest.raises(ExpectationNotMet):
        check(system, "tracker", "vision/left/tracks", "publish")


def test_a_relay_may_not_send_frames_as_the_camera_itself(system: Secured):
    assert "allowed" in check(system, "relay_front", "vision/front/relayed/compressed", "publish")
    assert "allowed" in check(system, "relay_front", "vision/front/image/compressed", "subscribe")
    with pytest.raises(ExpectationNotMet):
        check(system, "relay_front", "vision/front/image/compressed", "publish")


def test_who_tells_of_events_receives_those_of_all_cameras_and_publishes_nothing(system: Secured):
    for name in ("notify", "notify_front"):
        assert "allowed" in check(system, name, "vision/*/events", "subscribe")
        with pytest.raises(ExpectationNotMet):
            check(system, name, "vision/front/events", "publish")


def test_no_service_of_a_camera_may_publish_what_another_does(system: Secured):
    owners: dict[str, set[str]] = {}
    for name, holder in Folder(str(system.folder)).system().holders.items():
        if holder.role.kind in SERVICES and holder.role.kind != "router":
            allowed = rights_of(name, holder.role, "vision").allowed.get("publish", ())
            for key in allowed:
                owners.setdefault(key, set()).add(name)
    assert {key for key, names in owners.items() if len(names) > 1} == set()


def test_a_node_without_any_right_of_its_own_is_refused(system: Secured):
    for options in ({"node": "sum"}, {}, {"router": "far"}):
        with pytest.raises(ConfigurationError, match=r"needs|nobody is named"):
            system.add(**options)


def common_name(system: Secured, name: str) -> str:
    found = read_credentials(str(system.file(name)))
    subject = x509.load_pem_x509_certificate(found.pem(CERTIFICATE)).subject
    return str(subject.rfc4514_string())


def test_renewal_makes_another_key_under_the_same_name(system: Secured):
    before = read_credentials(str(system.file("camera_front")))
    rules = system.content("router")["access_control"]
    system.renew("camera_front", days=3)
    after = read_credentials(str(system.file("camera_front")))
    assert before.pem(KEY) != after.pem(KEY)
    assert common_name(system, "camera_front") == "CN=camera_front"
    assert after.validity.ends_s - after.validity.begins_s == 3 * 86400
    assert system.content("router")["access_control"] == rules
    assert "in 3 days: zv security renew camera_front --dir" in after.validity.warning()


def test_a_router_is_renewed_with_a_further_name(system: Secured):
    system.renew("router", host=("eye.example",))
    (tls,) = [system.content("router")["transport"]["link"]["tls"]]
    import base64

    certificate = x509.load_pem_x509_certificate(base64.b64decode(tls["listen_certificate_base64"]))
    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert {"eye.example", "localhost"} <= set(names.get_values_for_type(x509.DNSName))


def test_no_certificate_outlives_its_authority(system: Secured, monkeypatch, capsys):
    authority = Folder(str(system.folder)).authority()
    monkeypatch.setattr(authority_module, "datetime", later(authority.ends_s - 100 * DAY_S))
    system.renew("guest", days=90)
    assert read_credentials(str(system.file("guest"))).validity.ends_s < authority.ends_s
    assert "authority" not in capsys.readouterr().err
    system.renew("guest", days=110)
    assert read_credentials(str(system.file("guest"))).validity.ends_s == authority.ends_s
    assert "guest valid until the authority's end, 20" in capsys.readouterr().err
    system.add(node="spot_front", publishes=("vision/front/spot",))
    assert read_credentials(str(system.file("spot_front"))).validity.ends_s == authority.ends_s
    assert "spot_front valid until the authority's end, 20" in capsys.readouterr().err


def test_an_authority_that_has_ended_issues_nothing_and_still_revokes(system: Secured, monkeypatch):
    ends_s = Folder(str(system.folder)).authority().ends_s
    before = system.file("operator").read_bytes()
    monkeypatch.setattr(time, "time", lambda: ends_s + 60)
    with pytest.raises(ConfigurationError, match=r"the authority ended 2.*make another folder"):
        system.renew("operator")
    assert system.file("operator").read_bytes() == before
    system.revoke("guest")


def later(now_s: float) -> type:
    """Return the class ``datetime`` of a machine whose clock says something else."""

    class Later(datetime):
        @classmethod
        def now(cls, zone: tzinfo | None = None) -> Later:
            return cls.fromtimestamp(now_s, zone)

    return Later


def test_who_is_revoked_has_no_rule_and_no_file_and_comes_back_under_another_name(system: Secured):
    system.revoke("camera_front")
    assert not system.file("camera_front").exists()
    subjects = [each["id"] for each in system.content("router")["access_control"]["subjects"]]
    assert "camera_front" not in subjects
    with pytest.raises(ConfigurationError, match="camera_front is revoked"):
        system.revoke("camera_front")
    system.add(camera=("front",))
    assert common_name(system, "camera_front") == "CN=camera_front.2"
    subjects = [each["id"] for each in system.content("router")["access_control"]["subjects"]]
    assert "camera_front.2" in subjects
    assert "camera_front" not in subjects
    with pytest.raises(ConfigurationError, match="the only router cannot be revoked"):
        system.revoke("router")


@pytest.mark.parametrize("name", ["viewer", "recorder", "notify", "launcher", "guest", "sum"])
def test_whoever_is_revoked_comes_back_with_the_former_rights(system: Secured, name: str):
    system.add(node="sum", publishes=("vision/front/sum",))
    before = Folder(str(system.folder)).system().holder(name).role
    system.revoke(name)
    with pytest.raises(ConfigurationError, match=f"zv security add --node {name} gives it another"):
        system.renew(name)
    system.add(node=name)
    assert Folder(str(system.folder)).system().holder(name).role == before
    assert common_name(system, name) == f"CN={name}.2"
    with pytest.raises(ConfigurationError, match=f"{name} has a certificate already"):
        system.add(node=name)


def test_who_is_revoked_has_no_browser_file_and_the_viewer_that_admits_it_is_named(
    system: Secured, capsys
):
    quietly(web, WebOptions(dir=str(system.folder), name=("guest",)))
    assert (system.folder / "guest.p12").exists()
    system.revoke("guest", "camera_front")
    assert not (system.folder / "guest.p12").exists()
    said = capsys.readouterr().err
    assert "still admits the browsers of guest: take the name out of its --tls-operators" in said


def test_a_browser_file_with_a_certificate_that_has_ended_is_told(
    system: Secured, monkeypatch, capsys
):
    quietly(web, WebOptions(dir=str(system.folder), name=("guest",)))
    assert capsys.readouterr().err == ""
    now_s = time.time()
    monkeypatch.setattr(time, "time", lambda: now_s + 366 * DAY_S)
    quietly(web, WebOptions(dir=str(system.folder), name=("guest",)))
    said = f"guest.p12 are not let in: the certificate of guest ended {shown_time(now_s)[:2]}"
    assert said in capsys.readouterr().err


def test_damaged_credentials_give_no_browser_file(system: Secured):
    system.rewrite("guest", {})
    with pytest.raises(ConfigurationError, match=r"guest\.json5: no credentials of a node"):
        quietly(web, WebOptions(dir=str(system.folder), name=("guest",)))


def test_the_files_that_routers_elsewhere_need_are_named(system: Secured):
    assert "copy" not in system.revoke("guest")
    system.add(router="far", host=("far.example.com",))
    copied = f"copy {system.folder / 'far' / 'router.json5'} to where it runs"
    assert copied in system.revoke("operator")
    assert copied in system.add(node="operator")


def test_who_is_revoked_is_so_although_the_file_cannot_be_deleted(system: Secured, capsys):
    quietly(web, WebOptions(dir=str(system.folder), name=("guest",)))
    file = system.file("guest")
    file.unlink()
    file.mkdir()  # as Docker does, for a file that it is to mount and does not find
    with pytest.raises(SourceError, match="Is a directory; the certificate is revoked, delete"):
        system.revoke("guest")
    assert "guest" not in Folder(str(system.folder)).system().valid()
    assert "guest" not in system.file("router").read_text()
    assert "still admits the browsers of guest" in capsys.readouterr().err


def test_a_router_that_is_revoked_needs_its_name_again(system: Secured):
    system.add(router="far", host=("far.example.com",))
    system.revoke("far")
    with pytest.raises(ConfigurationError, match="--node far needs"):
        system.add(node="far")
    with pytest.raises(ConfigurationError, match="zv security add --router far --host HOST gives"):
        system.renew("far")


def test_show_lists_everybody_and_the_rights_of_one(system: Secured):
    system.revoke("guest")
    listed = quietly(showing.show, ShowOptions(dir=str(system.folder)))
    assert listed.count("valid") == len(list(system.folder.rglob("*.json5")))
    assert "revoked" in listed
    rights = quietly(showing.show, ShowOptions(dir=str(system.folder), name="edge_front"))
    rows = [line.split() for line in rights.splitlines()]
    assert ["publish", "vision/front/edges/compressed"] in rows
    assert ["publish", "vision/front/image/compressed"] not in rows


# Bad input


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--host", "bücher.local"], "allowed: a host's name or address, without port"),
        (
            ["--guest", "me", "--guest", "Me"],
            "--guest = 'Me' is not allowed; allowed: letters a-z, digits and _; default 'guest'\n",
        ),
        (["--host", "a", "--host", "cam.example:7447"], "--host = 'cam.example:7447' is not"),
        (["--host", "192.168.0.256"], "--host = '192.168.0.256' is not"),
        (["--host", "cam..example"], "--host = 'cam..example' is not"),
        (["--host", "0.0.0.0"], "--host = '0.0.0.0' is not"),
        (["--host", "fe80::1%eth0"], "--host = 'fe80::1%eth0' is not"),
    ],
)
def test_what_is_allowed_in_a_list_is_said_of_its_items(tmp_path, words: list[str], said: str):
    done = type_zv(["security", "init", str(tmp_path / "new"), *words], folder=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("endpoint", ["far.example:7447", "tcp/far.example:7447", "tls/far"])
def test_a_router_connects_to_another_one_by_tls_only(system: Secured, endpoint: str):
    words = ["--router", "near", "--host", "near.example", "--connect-to", endpoint]
    done = type_zv(["security", "add", "--dir", str(system.folder), *words], folder=system.folder)
    assert done.returncode == 2
    assert f"--connect-to = '{endpoint}' is not allowed (it " in done.stderr
    assert not system.file("near").exists()


def test_a_router_has_addresses_of_both_kinds(tmp_path: Path):
    words = ["--host", "::1", "--host", "192.168.0.2", "--host", "cam-1.example", "--port", "7448"]
    done = type_zv(["security", "init", str(tmp_path / "new"), *words], folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "the router is found at tls/[::1]:7448; " in done.stdout


def test_a_folder_without_certificates_is_named(tmp_path):
    nowhere = Secured(tmp_path, 1)
    for call in (lambda: nowhere.add(camera=("front",)), lambda: nowhere.revoke("x")):
        with pytest.raises(SourceError, match="no such file; zv security init makes the folder"):
            call()


def test_keys_that_others_can_read_are_not_used(system: Secured):
    system.file("camera_front").chmod(0o644)
    with pytest.raises(ConfigurationError, match=r"mode is 0644.*chmod 600"):
        read_credentials(str(system.file("camera_front")))
    (system.folder / "ca.key").chmod(0o640)
    with pytest.raises(ConfigurationError, match=r"ca\.key: its mode is 0640"):
        system.add(camera=("left",))


def test_keys_that_are_mixed_up_are_named(system: Secured, tmp_path):
    content, other = system.content("camera_front"), system.content("edge_front")
    tls, others = (each["transport"]["link"]["tls"] for each in (content, other))
    tls[KEY] = others[KEY]
    system.rewrite("camera_front", content)
    with pytest.raises(ConfigurationError, match="the private key is not the certificate's"):
        read_credentials(str(system.file("camera_front")))
    foreign = secured(tmp_path / "foreign").content("camera_front")
    content = system.content("edge_front")
    for part in (CERTIFICATE, KEY):
        content["transport"]["link"]["tls"][part] = foreign["transport"]["link"]["tls"][part]
    system.rewrite("edge_front", content)
    with pytest.raises(ConfigurationError, match="was not issued by the authority in it"):
        read_credentials(str(system.file("edge_front")))
    foreign_key = (tmp_path / "foreign" / "security" / "ca.key").read_text()
    (system.folder / "ca.key").write_text(foreign_key)
    with pytest.raises(ConfigurationError, match="the key is not that of the certificate"):
        system.add(camera=("left",))


@pytest.mark.parametrize("size", [0, 1, 100, 2000, -2])
def test_a_file_that_was_cut_short_is_named(system: Secured, size: int):
    file = system.file("camera_front")
    file.write_text(file.read_text()[:size])
    with pytest.raises(ConfigurationError, match=r"camera_front\.json5: .*zv security renew"):
        read_credentials(str(file))


def test_a_folder_or_a_missing_file_is_no_credentials(system: Secured):
    with pytest.raises(ConfigurationError, match=r"a folder; allowed: a file: .*camera_front"):
        read_credentials(str(system.folder))
    with pytest.raises(SourceError, match="no such file; zv security init writes those"):
        read_credentials(str(system.folder / "nobody"))
    with pytest.raises(ConfigurationError, match="no credentials of a node"):
        read_credentials(str(system.file("router")))


def test_the_folder_where_one_is_is_no_credentials(system: Secured, monkeypatch):
    monkeypatch.chdir(system.folder)
    with pytest.raises(
        ConfigurationError, match=r"credentials \.: a folder; allowed: .*camera_front"
    ):
        read_credentials(".")
    assert read_credentials("./guest").name == "guest"


def test_a_file_that_is_for_others_is_no_credentials(system: Secured):
    quietly(web, WebOptions(dir=str(system.folder)))
    for name in ("ca.key", "web.pem", "operator.p12"):
        with pytest.raises(ConfigurationError, match=f"{name}: no credentials; allowed: DIR"):
            read_credentials(str(system.folder / name))


def test_the_command_that_mends_a_file_of_a_router_names_its_holder_and_folder(system: Secured):
    system.add(router="far", host=("far.example",))
    for name in ("router", "far", "camera_front"):
        file = system.file(name)
        said = rf"zv security renew {name} --dir {system.folder} writes it again"
        if file.name == ROUTER_FILE:
            with pytest.raises(ConfigurationError, match=said):
                read_credentials(str(file))  # it is whole, but of no node
        file.write_text("{")
        with pytest.raises(ConfigurationError, match=f"cut short or damaged; {said}"):
            read_json5(file)


class Died(Exception):
    """Stands for a kill."""


@pytest.mark.parametrize("last", ["ca.key", "ca.pem", "router.json5", "guest.json5", "compose.env"])
def test_an_init_that_died_is_told_by_every_command_until_the_folder_is_deleted(
    tmp_path, monkeypatch, last: str
):
    system = Secured(tmp_path / "security", 7447)
    put = Folder.put

    def dies(folder: Folder, target: Path, text: str, mode: int) -> None:
        put(folder, target, text, mode)
        if target.name == last:
            raise Died

    monkeypatch.setattr(Folder, "put", dies)
    with pytest.raises(Died):
        system.init()
    monkeypatch.undo()
    commands = (
        system.init,
        lambda: system.add(camera=("rear",)),
        lambda: system.renew("router"),
        lambda: system.revoke("guest"),
        lambda: check(system, "guest", "vision/front/image", "subscribe"),
    )
    for command in commands:
        with pytest.raises(SourceError, match=f"not finished: delete {system.folder} and begin"):
            command()
    shutil.rmtree(system.folder)
    system.init()
    assert "allowed" in check(system, "guest", "vision/front/image", "subscribe")


def test_an_authority_that_is_lost_is_copied_back_and_not_made_again(system: Secured):
    (system.folder / "ca.pem").unlink()
    for command in (lambda: system.add(camera=("rear",)), lambda: system.renew("guest")):
        with pytest.raises(SourceError, match=r"ca\.pem: no such file; copy it back"):
            command()


def contents(folder: Path) -> dict[str, bytes]:
    return {str(each): each.read_bytes() for each in folder.rglob("*") if each.is_file()}


def test_a_full_disk_leaves_each_file_as_it_was(system: Secured, monkeypatch):
    before = contents(system.folder)

    def full(*_args: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(SourceError, match="No space left on device; the file is as it was before"):
        system.renew("camera_front")
    assert contents(system.folder) == before


@pytest.mark.parametrize(
    "damage", [lambda text: '{"namespace": "vision"}', lambda text: text.replace("guest", "host")]
)
def test_a_damaged_list_of_holders_is_named(system: Secured, damage: Callable[[str], str]):
    file = system.folder / "security.json"
    file.write_text(damage(file.read_text()))
    with pytest.raises(ConfigurationError, match=r"security\.json: damaged"):
        system.add(camera=("left",))


@pytest.mark.parametrize("part", [None, {}, 5, {"link": {"tls": 5}, "subjects": [{"id": []}]}])
def test_a_damaged_file_of_a_router_is_named_with_what_writes_it_again(
    system: Secured, part: object
):
    system.rewrite("router", {"transport": part, "access_control": part})
    with pytest.raises(ConfigurationError, match=r"router\.json5: damaged; zv security renew"):
        check(system, "camera_front", "vision/front/image", "publish")
    with pytest.raises(ConfigurationError, match=r"router\.json5: damaged; zv security renew"):
        system.add(camera=("left",))
    assert "router: valid until" in system.renew("router")
    assert "allowed" in check(system, "camera_front", "vision/front/image", "publish")


def test_the_key_of_the_authority_may_be_kept_elsewhere(system: Secured):
    (system.folder / "ca.key").rename(system.folder.parent / "ca.key")
    with pytest.raises(SourceError, match="the authority's key is not here"):
        system.renew("camera_front")
    assert "allowed" in check(system, "camera_front", "vision/front/image", "publish")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root writes for others")
def test_what_root_changes_stays_its_owners(system: Secured):
    """Else neither a container nor a node could read its file, and the former rules would hold."""
    for each in (system.folder, *system.folder.rglob("*")):
        os.chown(each, 4321, 4322)
    system.add(camera=("left",), router="far", host=("far.example",))
    system.revoke("camera_front")
    written = [*system.folder.rglob("*")]
    assert system.file("far") in written
    assert {(each.stat().st_uid, each.stat().st_gid) for each in written} == {(4321, 4322)}


def test_two_commands_at_once_do_not_lose_a_holder(system: Secured):
    from concurrent.futures import ThreadPoolExecutor

    names = [f"friend{number}" for number in range(4)]
    with ThreadPoolExecutor(4) as beside:
        folder = Folder(str(system.folder))
        assert folder.system().holders
        from tests.support.secured import AddOptions, commands

        list(
            beside.map(
                lambda name: commands.add(
                    AddOptions(dir=str(system.folder), guest=(name,)),
                    Connection(),
                    Output(as_json=True),
                ),
                names,
            )
        )
    assert set(names) <= Folder(str(system.folder)).system().holders.keys()


def test_the_authority_of_another_system_is_told_and_nothing_is_overwritten(
    system: Secured, tmp_path: Path
):
    (tmp_path / "other").mkdir()
    other = secured(tmp_path / "other")
    for name in ("ca.pem", "ca.key"):
        (system.folder / name).write_bytes((other.folder / name).read_bytes())
    before = {each: each.read_bytes() for each in system.folder.rglob("*") if each.is_file()}
    for call in (lambda: system.renew("guest"), lambda: system.add(guest=("max",))):
        with pytest.raises(ConfigurationError, match="not the authority of "):
            call()
    after = {each: each.read_bytes() for each in system.folder.rglob("*") if each.is_file()}
    assert after == before


def test_a_router_s_file_that_is_missing_is_told_with_the_command_that_writes_it(system: Secured):
    system.file("router").unlink()
    file = system.folder / "router" / "router.json5"
    with pytest.raises(SourceError, match="no such file; zv security renew router --dir"):
        system.add(guest=("max",))
    system.renew("router")
    assert file.is_file()
