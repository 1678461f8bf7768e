"""Where the embedded router listens: what it was told, and it says so."""

from __future__ import annotations

import os
import re
import subprocess
import time
from pathlib import Path

import psutil
import pytest

from tests.support.fork_server import ZV
from tests.support.listening import newest, open_client
from tests.support.processes import START_S, Program, need
from tests.support.routing import free_port, port_answers
from tests.support.waiting import wait_until
from zv.router.watchdog import HUNG_S

HERE = "tcp/127.0.0.1"


def a_router(folder: Path, listen: str, file: str | None) -> Program:
    flags = ["router", "--listen", listen]
    if file is not None:
        (folder / "router.json5").write_text(file)
        flags += ["--zenoh-config", str(folder / "router.json5")]
    return Program(flags, folder, "router", forked=ZV)


def listens(router: Program) -> str:
    def said() -> re.Match[str] | None:
        assert router.process.poll() is None, router.complaints
        return re.search(r"router listens on (.*)\n", router.complaints)

    return wait_until(said, START_S)[1]


def ports(router: Program) -> set[int]:
    """Return the ports that the process has open, by the kernel."""
    opened = psutil.Process(router.process.pid).net_connections("inet")
    # Without scouting there is no UDP socket either.
    return {c.laddr.port for c in opened if c.status in (psutil.CONN_LISTEN, psutil.CONN_NONE)}


@pytest.mark.parametrize(
    ("file", "where"),
    [
        (None, "{flag}"),
        ("{{}}", "{flag}"),
        ("{{ connect: {{ endpoints: ['tcp/127.0.0.1:9'] }} }}", "{flag}"),
        ("{{ listen: {{ endpoints: ['{file}'] }} }}", "{file}"),
        ("{{ listen: {{ endpoints: ['{flag}', '{file}'] }} }}", "{flag}, {file}"),
    ],
    ids=["no file", "empty", "connects only", "listens elsewhere", "two"],
)
def test_it_listens_on_what_the_file_states_else_on_the_flag(tmp_path, file, where):
    places = {"flag": f"{HERE}:{free_port()}", "file": f"{HERE}:{free_port()}"}
    said = where.format(**places)
    text = None if file is None else file.format(**places)
    with a_router(tmp_path, places["flag"], text) as router:
        assert listens(router) == said
        assert ports(router) == {int(port) for port in re.findall(r":(\d+)", said)}
        assert router.process.poll() is None


@pytest.mark.parametrize("listen", [f"{HERE}:0", f"{HERE}:0#so_sndbuf=65536"])
def test_the_port_chosen_for_0_is_logged(tmp_path, listen):
    with a_router(tmp_path, listen, None) as router:
        said = listens(router)
        port = int(re.search(r":(\d+)", said)[1])
        assert said == listen.replace(":0", f":{port}")
        assert port_answers(port)


def test_a_small_send_buffer_is_taken_by_the_connections(tmp_path):
    with a_router(tmp_path, f"{HERE}:0#so_sndbuf=32768", None) as router:
        port = re.search(r":(\d+)", listens(router))[1]
        with open_client(f"{HERE}:{port}"):
            shown = subprocess.run(
                [need("ss", "iproute2"), "-tnmH", "state", "established", f"sport = :{port}"],
                capture_output=True,
                text=True,
                check=True,
            ).stdout
    # The kernel doubles what is asked for, to have room for its own records (man 7 socket).
    assert re.findall(r"\btb(\d+)", shown) == ["65536"], shown


def test_a_taken_port_in_the_file_is_said_of_the_file(tmp_path):
    with a_router(tmp_path, f"{HERE}:0", None) as first:
        taken = listens(first)
        second = tmp_path / "second"
        second.mkdir()
        text = f"{{ listen: {{ endpoints: ['{taken}'] }} }}"
        with a_router(second, f"{HERE}:{free_port()}", text) as router:
            assert router.process.wait(START_S) == 2
            assert f"{second / 'router.json5'}: listen/endpoints = '{taken}'" in router.complaints
            assert "the port is in use" in router.complaints


def test_a_router_that_has_locked_up_says_so_and_ends_with_1(tmp_path):
    """A newer Zenoh may not lock up so: then the watchdog may go."""
    with a_router(tmp_path, f"{HERE}:0", None) as router:
        attack = ["-m", "tests.support.programs.lock_up_router", listens(router)]
        with Program(attack, tmp_path, "attack") as attacker:
            status = router.process.wait(100)
            attacker.process.kill()  # Zenoh would take long to close its sessions
    assert status == 1
    assert "Zenoh has locked up: no answer for 5 s; ends, to be restarted" in router.complaints


def test_a_program_that_answers_no_query_does_not_make_a_router_end(tmp_path):
    with a_router(tmp_path, f"{HERE}:0", None) as router, open_client(listens(router)) as session:
        kept = []
        with session.declare_queryable("@/**", lambda query: kept.append(query)):
            begun_s = time.monotonic()
            wait_until(lambda: len(kept) > 1 and time.monotonic() - begun_s > HUNG_S + 1)
        assert router.process.poll() is None


LAUNCH = '[router]\nzenoh_config = "router.json5"\n[[node]]\nservice = "tracker"\n'


def test_the_nodes_of_zv_up_go_where_the_routers_file_says(tmp_path):
    endpoint = f"{HERE}:{free_port()}"
    (tmp_path / "router.json5").write_text(f"{{ listen: {{ endpoints: ['{endpoint}'] }} }}")
    (tmp_path / "up.toml").write_text(LAUNCH)
    flags = ["up", "--plain", str(tmp_path / "up.toml")]
    with Program(flags, tmp_path, "up", forked=ZV) as program:
        program.lines(rf"router: {re.escape(endpoint)} .*")
        with open_client(endpoint) as session:
            newest(session, "@vision/diagnostics/tracker_front")
        assert program.interrupt() == 0


@pytest.mark.parametrize("endpoints", ["[]", f"['{HERE}:0']"])
def test_zv_up_refuses_a_file_that_hides_the_router_from_the_nodes(tmp_path, endpoints):
    (tmp_path / "router.json5").write_text(f"{{ listen: {{ endpoints: {endpoints} }} }}")
    (tmp_path / "up.toml").write_text(LAUNCH)
    flags = ["up", "--plain", str(tmp_path / "up.toml")]
    with Program(flags, tmp_path, "up", forked=ZV) as program:
        assert program.process.wait(START_S) == 2
    assert f"router.json5: listen/endpoints = {endpoints}" in program.complaints
    assert len(program.complaints.strip().split(os.linesep)) == 1
