"""docs/viewer.md is true: its messages, parameters and limits are those of the code."""

from __future__ import annotations

import re
import shlex
import urllib.request
from pathlib import Path

import pytest
from aiohttp import WSCloseCode

from services.viewer import (
    compatible,
    connections,
    hub,
    listening,
    live,
    messages,
    queries,
    requests,
    web,
)
from services.viewer.access import cookie_name
from tests.integration.routing import free_port
from tests.pages import Page
from tests.processes import Program

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "docs" / "viewer.md").read_text()
FOLDER = ROOT / "services" / "viewer"


def section(title: str) -> str:
    return TEXT.partition(f"### {title}\n")[2].partition("\n#")[0]


@pytest.mark.parametrize("command", Page("docs/viewer.md").commands())
def test_a_command_starts_a_viewer_and_prints_its_address(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    words = shlex.split(command)
    assert words[:2] == ["zv", "view"]
    ours = [str(free_port()) if word == "8081" else word for word in words[1:]]
    with Program(["-m", "services", *ours], tmp_path, "view") as program:
        found = program.lines(r"http://(\S+):(\d+)/(\?token=\S+)?")[0]
        assert bool(found[3]) == ("--host" in words)
        health = f"http://127.0.0.1:{found[2]}/healthz"
        with urllib.request.urlopen(health, timeout=10) as answer:
            assert answer.read() == b"ok\n"
        assert program.interrupt() == 0


def test_what_a_page_may_say_is_all_there():
    said = set(re.findall(r'^\| `\{"op":"(\w+)"', section("From the page"), re.MULTILINE))
    known = set(re.findall(r'op: Literal\["(\w+)"\]', (FOLDER / "requests.py").read_text()))
    assert said == known
    assert len(known) == 5


def test_what_a_page_is_told_is_all_there():
    said = set(re.findall(r'^\| `\{"op":"(\w+)"', section("To the page"), re.MULTILINE))
    code = "".join(path.read_text() for path in FOLDER.glob("*.py"))
    assert said == set(re.findall(r'(?:wire\.)?text\(\s*"(\w+)",', code))


def test_the_parameters_of_a_stream_are_all_there():
    table = TEXT.partition("| parameter |")[2].partition("\n\n")[0]
    assert set(re.findall(r"`(\w+)`", " ".join(re.findall(r"^\| (`.*?) \|", table, re.M)))) == set(
        queries.NAMES
    )


def test_the_addresses_are_all_there():
    table = TEXT.partition("| address |")[2].partition("\n\n")[0]
    said = {path.partition("?")[0] for path in re.findall(r"^\| `(\S+?)`", table, re.M)}
    code = (FOLDER / "web.py").read_text()
    served = set(re.findall(r'add_get\(\s*"([^"]+)"', code))
    assert said == served - {"/page/{name}", "/favicon.ico"}


def test_the_limits_are_those_of_the_code():
    for words in (
        f"{requests.MAX_BYTES >> 10} kB in a message, {requests.MAX_RATE_HZ} messages a second",
        f"Too large: the connection is closed with code {WSCloseCode.MESSAGE_TOO_BIG:d}",
        f"or other than text: with {WSCloseCode.POLICY_VIOLATION:d}",
        f"watches at most {live.MAX_WATCHES} streams",
        f"{messages.QUEUE} wait for a page",
        f"At most {live.AHEAD} are sent ahead",
        f"the kernel's buffer ({listening.SEND_BUFFER_BYTES >> 10} kB)",
        f"is left after {compatible.STALLED_S:.0f} s",
        f"reads nothing for {live.STALLED_S:.0f} s",
        f"does not say within {connections.FIRST_REQUEST_S:.0f} s",
        f"at most {connections.MAX_IDLE} stay",
        f"if that is {web.STALLED_S:.0f} s or more",
        f"cookie `{cookie_name('localhost:8080').replace('8080', 'PORT')}`",
        f"(`{cookie_name('localhost')}` where the address has no port",
    ):
        assert words in TEXT, words
    assert web.NO_TOKEN == ("/healthz",)
    assert hub.MAX_KEYS > live.MAX_WATCHES
