"""docs/parameters.md and the README's part on it are true: what they show runs as written."""

from __future__ import annotations

import re
from pathlib import Path

import msgpack
import pytest

from tests.support.fork_server import SCRIPT
from tests.support.listening import open_client
from tests.support.processes import Program
from tests.support.typist import type_zv, zv
from tests.support.viewer.pages import Page, run_as_written
from tests.support.waiting import wait_until
from zenoh_vision.config.settings import load_settings
from zv.registry import model_of
from zv.tools.registry import TOOLS

PAGE = Page("docs/parameters.md")
README = Page("README.md")
OURS = "zv param "


def test_every_command_of_the_tool_is_shown():
    shown = {" ".join(line.split()[1:3]) for line in PAGE.commands(OURS)}
    assert shown == {words for words in TOOLS if words.startswith("param ")}


@pytest.mark.parametrize("page", [PAGE, README], ids=lambda page: page.name)
def test_the_commands_run_as_written_one_after_the_other(page: Page, endpoint: str, tmp_path: Path):
    assert page.commands(OURS)
    for command in page.commands(OURS):
        done = run_as_written(command, tmp_path, ZV_CONNECT=endpoint)
        assert done.returncode == 0, (command, done.stderr)
        assert done.stdout or "at revision" in done.stderr or "written to" in done.stderr
    if page is PAGE:
        saved = load_settings(model_of("tracker"), config=tmp_path / "tracker.toml")
        assert saved.model_dump()["closing"] == 10


def test_the_program_sets_two_parameters_as_written(endpoint: str, tmp_path: Path):
    program = tmp_path / "set.py"
    program.write_text(PAGE.blocks("python")[0])
    done = type_zv([program, endpoint], program=SCRIPT)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert re.fullmatch(r"revision \d+", lines[0])
    assert {"closing 10", "threshold 100"} <= set(lines)


def test_the_service_of_ones_own_takes_what_is_set(endpoint: str, tmp_path: Path):
    program = tmp_path / "dimmer.py"
    program.write_text(PAGE.blocks("python")[1])
    command: list[str | Path] = [program, "--connect", endpoint]
    with Program(command, tmp_path, "dimmer", SCRIPT) as running, open_client(endpoint) as session:
        running.lines(r"\d+ [1-9][\d.]+")
        key, payload = "@vision/set/dimmer_front/gain", msgpack.packb(0)
        (reply,) = wait_until(lambda: list(session.get(key, payload=payload)))
        assert msgpack.unpackb(reply.ok.payload.to_bytes())["unit"] == "ratio"
        running.lines(r"\d+ 0\.0")
        saved = tmp_path / "dump.toml"
        assert zv(endpoint, "param", "dump", "dimmer_front", "-o", str(saved)).returncode == 0
        assert running.interrupt() == 0
    # What was dumped holds at the next start.
    command += ["--config", saved]
    with Program(command, tmp_path, "again", SCRIPT) as running:
        running.lines(r"\d+ 0\.0")
        assert not re.search(r"^\d+ [1-9]", running.output, re.MULTILINE)
        assert running.interrupt() == 0


def test_what_the_page_names_is_a_parameter():
    live = set().union(*(model_of(each).model_fields for each in ("camera", "tracker", "edge")))
    section = PAGE.text.split("## When a change takes effect")[1].split("\n## ")[0]
    assert set(re.findall(r"`([a-z_]+)`", section)) - {"truth", "now"} <= live
