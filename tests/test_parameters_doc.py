"""docs/parameters.md and the README's part on it are true: what they show runs as written."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import msgpack
import pytest

from common.settings import load_settings
from services.catalogue import model_of
from services.tools.catalogue import TOOLS
from tests.processes import (
    ROOT,
    START_S,
    Program,
    client,
    environment,
    newest,
    router,
    service,
)

PAGE = (ROOT / "docs" / "parameters.md").read_text()
README = (ROOT / "README.md").read_text()
IMPORTS = """
from typing import Annotated, ClassVar
from pydantic import Field
from common.live import LiveSettings
from common.node import Node
from common.parameters import Live
from common.connection import Connection
from common.settings import ServiceSettings
"""


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)


def commands(page: str) -> list[list[str]]:
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    found = [shlex.split(line, comments=True) for line in lines]
    return [words for words in found if words[:2] == ["zv", "param"]]


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A router, the synthetic camera and a tracker; the endpoint."""
    folder = tmp_path_factory.mktemp("system")
    with ExitStack() as running:
        program, endpoint = router(folder)
        running.enter_context(program)
        for name in ("camera", "tracker"):
            running.enter_context(service(name, folder, "--connect", endpoint))
        with client(endpoint) as session:
            newest(session, "vision/front/centroid")
        yield endpoint


def test_every_command_of_the_tool_is_shown():
    shown = {" ".join(words[1:3]) for words in commands(PAGE)}
    assert shown == {words for words in TOOLS if words.startswith("param ")}


@pytest.mark.parametrize("page", [PAGE, README], ids=["parameters.md", "README.md"])
def test_the_commands_run_as_written_one_after_the_other(page: str, endpoint: str, tmp_path: Path):
    assert commands(page)
    for words in commands(page):
        done = subprocess.run(
            [sys.executable, "-m", "services", *words[1:]],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env=environment() | {"ZV_CONNECT": endpoint},
            timeout=START_S,
            check=False,
        )
        assert done.returncode == 0, (words, done.stderr)
        assert done.stdout or "at revision" in done.stderr or "written to" in done.stderr
    saved = load_settings(model_of("tracker"), config=tmp_path / "tracker.toml")
    assert saved.model_dump()["closing"] == 10


def test_the_program_sets_two_parameters_as_written(endpoint: str, tmp_path: Path):
    program = tmp_path / "set.py"
    program.write_text(blocks(PAGE, "python")[0])
    done = subprocess.run(
        [sys.executable, program, endpoint],
        capture_output=True,
        text=True,
        timeout=START_S,
        check=True,
    )
    lines = done.stdout.splitlines()
    assert re.fullmatch(r"revision \d+", lines[0])
    assert {"closing 10", "threshold 100"} <= set(lines)


def test_the_service_of_ones_own_takes_what_is_set(endpoint: str, tmp_path: Path):
    program = tmp_path / "dimmer.py"
    connected = f"parameters=live, connection=Connection({endpoint!r})"
    code = blocks(PAGE, "python")[1].replace("parameters=live", connected)
    program.write_text(IMPORTS + code)
    with Program([program], tmp_path, "dimmer") as running, client(endpoint) as session:
        running.lines(r"\d+ [1-9][\d.]+")
        (reply,) = session.get("@vision/param/dimmer_front/gain", payload=msgpack.packb(0))
        assert msgpack.unpackb(reply.ok.payload.to_bytes())["unit"] == "ratio"
        running.lines(r"\d+ 0\.0")
        assert running.interrupt() == 0


def test_what_the_page_names_is_a_parameter():
    live = {name for service in ("camera", "tracker", "edge") for name in fields(service)}
    said = re.findall(
        r"`([a-z_]+)`", PAGE.split("## When a change is in force")[1].split("\n## ")[0]
    )
    assert set(said) - {"truth", "now"} <= live


def fields(service: str) -> set[str]:
    return set(model_of(service).model_fields)
