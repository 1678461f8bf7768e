"""The pages about the viewer are true: commands run, messages and limits are those of the code."""

from __future__ import annotations

import re
import shlex
import urllib.request
from pathlib import Path

import pytest
from aiohttp import WSCloseCode

from tests.support.fork_server import ZV
from tests.support.processes import Program
from tests.support.routing import free_port
from tests.support.viewer.pages import Page
from zenoh_vision.transport.connection import Connection
from zv.launcher.launch_file import Plan, PlannedNode
from zv.launcher.starting import how_to_subscribe
from zv.viewer import credentials
from zv.viewer.http import access, app, connections, listener
from zv.viewer.settings import ViewerSettings
from zv.viewer.streams import message_stream, registry
from zv.viewer.web_video_server import query
from zv.viewer.websocket import audit, commands, sender, session

ROOT = Path(__file__).parents[2]
GUIDE = (ROOT / "docs" / "viewer.md").read_text()
TEXT = (ROOT / "docs" / "viewer_reference.md").read_text()
FOLDER = ROOT / "services" / "zv" / "viewer"


def section(title: str, page: str = TEXT) -> str:
    return page.partition(f"## {title}\n")[2].partition("\n#")[0]


@pytest.mark.parametrize("command", Page("docs/viewer.md").commands())
def test_a_command_starts_a_viewer_and_prints_its_address(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    words = shlex.split(command)
    assert words[:2] == ["zv", "view"]
    ours = [str(free_port()) if word == "8081" else word for word in words[1:]]
    with Program(ours, tmp_path, "view", forked=ZV) as program:
        found = program.lines(r"http://(\S+):(\d+)/(\?token=\S+)?")[0]
        assert bool(found[3]) == ("--host" in words)
        health = f"http://127.0.0.1:{found[2]}/healthz"
        with urllib.request.urlopen(health, timeout=10) as answer:
            assert answer.read() == b"ok\n"
        assert program.interrupt() == 0


def test_the_addresses_of_both_scopes_are_printed_as_the_table_says(tmp_path: Path):
    said = re.findall(r"`([\w, :]*)http://\.\.\.`", section("Tokens and sessions"))
    token = "0123456789abcdef-token"
    settings = ViewerSettings(token=token, port=free_port())
    planned = PlannedNode("viewer", "viewer", settings, restart=True)
    plan = Plan("up.toml", {}, None, None, (planned,))
    by_up = how_to_subscribe(plan, Connection(), own_router=True)[-2:]
    with Program(["view", "--port", "0", "--token", token], tmp_path, "view", forked=ZV) as program:
        program.lines(r"view only: \S+")
        by_view = program.output.splitlines()[:2]
        assert program.interrupt() == 0
    control, view = (line.partition("http:")[0] for line in by_view)
    assert by_view[0].endswith(token)
    up_view, up_control = (line.partition("http:")[0] for line in by_up)
    assert by_up[1].endswith(token)
    assert said == [control, up_control, view, up_view]


def test_what_a_page_may_say_is_all_there():
    said = set(re.findall(r'^\| `\{"op":"(\w+)"', section("From the page"), re.MULTILINE))
    known = set(
        re.findall(r'op: Literal\["(\w+)"\]', (FOLDER / "websocket" / "commands.py").read_text())
    )
    assert said == known
    assert len(known) == 6


def test_what_a_page_is_told_is_all_there():
    said = set(re.findall(r'^\| `\{"op":"(\w+)"', section("To the page"), re.MULTILINE))
    code = "".join(path.read_text() for path in FOLDER.glob("**/*.py"))
    assert said == set(re.findall(r'(?:events\.)?text\(\s*"(\w+)",', code))


def test_the_parameters_of_a_stream_are_all_there():
    table = TEXT.partition("| parameter |")[2].partition("\n\n")[0]
    assert set(re.findall(r"`(\w+)`", " ".join(re.findall(r"^\| (`.*?) \|", table, re.M)))) == set(
        query.NAMES
    )


def test_the_addresses_are_all_there():
    table = TEXT.partition("| address |")[2].partition("\n\n")[0]
    said = {path.partition("?")[0] for path in re.findall(r"^\| `(\S+?)`", table, re.M)}
    code = (FOLDER / "http" / "app.py").read_text()
    routes = re.findall(r'add\(f"{base}([^"]+)"', code)
    served = {re.sub(r"{{number:.*}}", "NUMBER", route) for route in routes}
    assert said == served - {"/page/{{name:.+}}", "/favicon.ico"}


def test_the_limits_are_those_of_the_code():
    for words in (
        f"{commands.MAX_BYTES >> 10} kB in a message and {commands.MAX_RATE_HZ} messages a second",
        f"too large closes the connection with code {WSCloseCode.MESSAGE_TOO_BIG:d}",
        f"not text, with {WSCloseCode.POLICY_VIOLATION:d}",
        f"watch at most {session.MAX_WATCHES} streams",
        f"at most {message_stream.QUEUE} are queued for a page",
        f"At most {sender.AHEAD} pictures are sent without acknowledgement",
        f"the kernel's buffer ({listener.SEND_BUFFER_BYTES >> 10} kB)",
        f"is disconnected after {connections.LEFT_S:.0f} s",
        f"reads nothing for {connections.LEFT_S:.0f} s",
        f"A connection without a request for {connections.FIRST_REQUEST_S:.0f} s is closed",
        f"at most {connections.MAX_IDLE} connections without a request are kept",
        f"if that is at least {app.STALLED_S:.0f} s",
        f"cookie `{access.cookie_name('localhost:8080').replace('8080', 'PORT')}`",
        f"(`{access.cookie_name('localhost')}` if the address has no port",
        f"an end {credentials.SESSION_S // 86400} days later",
        f"At most {audit.MAX_LINES} lines a second are logged",
        f"to {audit.MAX_REFUSED} lines a second for each client and {audit.MAX_LINES} for all",
    ):
        assert words in TEXT, words
    assert access.PUBLIC_PATHS == ("/healthz",)
    assert registry.MAX_KEYS > session.MAX_WATCHES


def test_the_options_of_a_layout_are_those_of_the_page():
    code = (FOLDER / "page" / "js" / "model" / "layout.js").read_text()
    text = section("A layout in the URL", GUIDE)
    rows = re.findall(r"^\| `(\w+)` \| (.+?) \|", text, re.MULTILINE)
    readers = code.partition("const READERS = {")[2].partition("\n};")[0]
    assert [name for name, _ in rows] == re.findall(r"^\t(\w+):", readers, re.MULTILINE)
    allowed = dict(rows)
    for name, constant in (("panel", "PANELS"), ("hide", "HIDEABLE")):
        listed = re.findall(
            r'"(\w+)"', code.partition(f"const {constant} = [")[2].partition("]")[0]
        )
        assert [each for each in re.findall(r"`(\w+)`", allowed[name]) if each != "none"] == listed
    for name, constant in (("columns", "MOST_COLUMNS"), ("width", "LARGEST_WIDTH")):
        assert (
            allowed[name] == f"1 to {code.partition(f'const {constant} = ')[2].partition(';')[0]}"
        )
    assert allowed["only"].startswith(f"up to {code.partition('const MOST_KEYS = ')[2][:2]} keys")
