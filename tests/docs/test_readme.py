"""The README and the first pages are true: commands run as written, code is the examples'."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.fork_server import SCRIPT
from tests.support.listening import living_nodes, newest, open_client
from tests.support.processes import ROOT, START_S, Program, run_program
from tests.support.routing import free_endpoint
from tests.support.systems import service, system
from tests.support.typist import type_zv
from tests.support.viewer.pages import Page, once_each, run_as_written
from tests.support.waiting import wait_until
from zv.cli.main import COMMANDS

README = Page("README.md")
RUN_HERE = [
    README,
    *(Page(f"docs/{name}.md") for name in ("cameras", "running", "testing", "metrics")),
]
LINES = once_each(*(line for page in RUN_HERE for line in page.commands()))
COMMANDS_SHOWN = [shlex.split(line) for line in LINES]
INDEX = ROOT / "docs" / "index.md"
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
MISSING_SOURCES = {"/path/to/video.mp4", "rtsp://192.0.2.10/stream1", "0", "/dev/video2"}
"""Devices that a test machine need not have: then the camera must say so, with exit status 3."""


def written(program: str, *second: str) -> list[object]:
    """Return the commands that begin so, each once, as test parameters: text and words."""
    chosen = {line: shlex.split(line) for line in LINES if line.startswith(f"{program} ")}
    return [
        pytest.param(words[1:], id=line)
        for line, words in chosen.items()
        if not second or words[1] in second
    ]


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a router and the nodes of configs/up.toml."""
    with system(tmp_path_factory.mktemp("system"), "tracker", "edge", "view") as endpoint:
        yield endpoint


def test_every_command_is_one_that_is_tested_here():
    here = {"make", "zv", "python", "source"}
    others = [line for line in LINES if shlex.split(line)[0] not in here]
    assert others == ["pipx install ."]  # what tests/smoke_wheel.sh does with pip
    assert {words[1] for words in COMMANDS_SHOWN if words[0] == "zv"} <= set(COMMANDS)
    targets = {words[1] for words in COMMANDS_SHOWN if words[0] == "make"}
    assert targets == {"up", "security", "test", "test-compose", "test-devices"}


@pytest.mark.parametrize("arguments", written("make"))
def test_a_make_command_has_its_target(arguments: list[str]):
    done = run_program(["make", "--dry-run", *arguments])
    assert done.returncode == 0, done.stderr
    expected = {"up": "bin/zv up configs/up.toml", "security": "bin/zv security init security"}
    assert expected.get(arguments[0], "bin/pytest") in done.stdout
    if "SECURE=security" in arguments:
        assert "--secure security" in done.stdout


def test_make_up_hands_its_source_to_the_camera():
    makefile = 'include Makefile\nshown:\n\t@echo "source $$ZV_CAMERA_SOURCE"\n'
    words = ["make", "--no-print-directory", "-f", "-", "shown", "SOURCE=walk.avi"]
    assert run_program(words, typed=makefile).stdout.strip() == "source walk.avi"


@pytest.mark.parametrize("flags", written("zv", "camera", "tracker", "edge"))
def test_a_node_starts_as_written_and_ends_with_ctrl_c(
    flags: list[str], empty: str, tmp_path: Path
):
    name, *options = flags
    with (
        open_client(empty) as session,
        service(name, tmp_path, *options, "--connect", empty) as program,
    ):
        source = options[options.index("--source") + 1] if "--source" in options else ""
        device = f"/dev/video{source}" if source.isdecimal() else source
        if "--list" in options and not any(Path("/dev").glob("video*")):
            assert program.process.wait(START_S) == 1
            assert "this machine has no video device" in program.complaints
            return
        if source in MISSING_SOURCES and not Path(device).exists():
            assert program.process.wait(START_S) == 3
            assert device in program.complaints
            return

        def alive() -> bool:
            assert program.process.poll() is None, program.complaints
            return f"@vision/node/{name}_front" in living_nodes(session)

        wait_until(alive, START_S, lambda: program.complaints)
        assert program.interrupt() == 0


@pytest.mark.parametrize("flags", written("zv", "metrics"))
def test_metrics_are_served_as_written_until_ctrl_c(
    flags: list[str], endpoint: str, tmp_path: Path
):
    # 9464 may well be in use.
    options = [*flags[1:], "--connect", endpoint, "--listen", "127.0.0.1:0"]
    with service(flags[0], tmp_path, *options) as program:
        url = program.lines(r"http://127\.0\.0\.1:\d+/metrics")[0][0]

        def served() -> bool:
            with urllib.request.urlopen(url, timeout=START_S) as answer:
                return b'zenoh_vision_node_up{node="camera_front"} 1.0' in answer.read()

        wait_until(served, START_S, lambda: program.complaints)
        assert program.interrupt() == 0


@pytest.mark.parametrize("flags", written("zv", "router"))
def test_the_router_starts_as_written_and_ends_with_ctrl_c(flags: list[str], tmp_path: Path):
    endpoint = free_endpoint()  # 7447 may well be in use
    with service(flags[0], tmp_path, *flags[1:], "--listen", endpoint) as program:
        open_client(endpoint).close()
        assert program.interrupt() == 0


@pytest.mark.parametrize(
    ("flags", "cameras"),
    [
        pytest.param(words[1:], ["left", "right"], id=" ".join(words))
        for words in COMMANDS_SHOWN
        if words[:2] == ["zv", "up"]
    ],
)
def test_zv_up_starts_a_system_and_ends_with_ctrl_c(
    flags: list[str], cameras: list[str], tmp_path: Path
):
    endpoint = free_endpoint()
    with service(flags[0], tmp_path, *flags[1:], "--plain", "--listen", endpoint) as program:
        with open_client(endpoint) as session:
            for camera in cameras:
                newest(session, f"vision/{camera}/centroid")
                newest(session, f"vision/{camera}/edges/compressed")
        assert program.interrupt() == 0, program.complaints


@pytest.mark.parametrize("command", [line for line in LINES if line.startswith("zv doctor")])
def test_the_doctor_runs_as_written(endpoint: str, command: str):
    done = run_as_written(command, ROOT, ZV_CONNECT=endpoint)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "tracker_front" in done.stdout


@pytest.mark.parametrize("arguments", written("python"))
def test_an_example_runs_as_written(endpoint: str, tmp_path: Path, arguments: list[str]):
    if "publish_from_anything.py" in arguments[0]:
        pytest.skip("tests/docs/test_examples.py runs it, where there is no other camera")
    words = [word if word != "tcp/127.0.0.1:7447" else endpoint for word in arguments]
    if "save_frame.py" in arguments[0]:
        words = [words[0], str(tmp_path / words[1]), endpoint, *words[3:]]
        done = type_zv(words, program=SCRIPT)
        assert done.returncode == 0, done.stderr
        saved = (tmp_path / arguments[1]).read_bytes()
        assert saved.startswith(b"\xff\xd8" if arguments[1].endswith(".jpg") else b"\x89PNG")
        return
    own = "own_service.py" in arguments[0]
    words += ["--connect"] * own + [endpoint]
    with Program(words, tmp_path, "example", SCRIPT) as program:
        if own:
            with open_client(endpoint) as session:
                newest(session, "vision/front/brightness")
        else:
            program.lines(r"front \d+ (\d+|None) (\d+|None) -?[\d.]+ ms", count=3)
        assert program.interrupt() == 0


@pytest.mark.parametrize("words", [w for w in COMMANDS_SHOWN if w[0] == "source"], ids=" ".join)
def test_completion_is_there_after_the_line_as_written(words: list[str], tmp_path: Path):
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("bash is not installed")
    command = tmp_path / "zv"
    command.write_text(f'#!/bin/sh\nexec {sys.executable} -m zv "$@"\n')
    command.chmod(0o755)
    typed = "COMP_WORDS=(zv came); COMP_CWORD=1; _zv_completion zv; echo ${COMPREPLY[@]}"
    done = run_program(
        [bash, "--norc", "-c", f"{' '.join(words)}\n{typed}"],
        PATH=f"{tmp_path}:{os.environ['PATH']}",
    )
    assert (done.stdout, done.stderr) == ("camera\n", "")


# Text


def test_the_code_shown_is_that_of_the_examples():
    subscriber, service_core = README.blocks("python")
    example = (ROOT / "examples" / "subscribe.py").read_text()
    assert subscriber.strip() == example.split('"""')[2].strip()
    assert service_core in (ROOT / "examples" / "own_service.py").read_text()


def test_the_output_shown_is_what_the_subscriber_prints():
    shown = README.blocks("text")[-1].splitlines()
    assert shown
    assert all(re.fullmatch(r"front \d+ (\d+|None) (\d+|None) [\d.]+ ms", line) for line in shown)


def links(page: Path) -> list[str]:
    prose = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    return [
        target
        for target in re.findall(r"\]\(([^)\s]+)\)", prose)
        if not target.startswith(("http://", "https://"))
    ]


def anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^a-z0-9_ -]", "", text.lower()).replace(" ", "-") for text in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_somewhere(page: Path):
    for target in links(page):
        path, _, anchor = target.partition("#")
        found = (page.parent / path).resolve() if path else page
        assert found.exists(), target
        if anchor:
            assert anchor in anchors(found), target


def test_every_document_and_example_is_linked_from_the_index():
    linked = {str((ROOT / "docs" / target.partition("#")[0]).resolve()) for target in links(INDEX)}
    wanted = {*ROOT.glob("docs/*.md"), *ROOT.glob("examples/*.py"), ROOT / "CHANGELOG.md"}
    assert {str(path) for path in wanted - {INDEX}} <= linked
    assert "docs/index.md" in links(ROOT / "README.md")
