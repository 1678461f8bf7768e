"""docs/messages.md is true: its keys, fields and reasons are the code's, its programs run."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.processes import ROOT, missing, need
from tests.support.viewer.pages import Page
from zenoh_vision import keys, messages
from zenoh_vision.image.bits import pack_bits
from zenoh_vision.image.pixel_formats import ENCODINGS
from zenoh_vision.message_codec import Message
from zenoh_vision.topics import TOPICS

PAGE = Page("docs/messages.md")
TEXT = PAGE.text
VECTORS = ROOT / "tests" / "vectors"
BUILD_S = 300.0
RUN_S = 30.0

CARGO = """
[package]
name = "read_message"
version = "0.0.0"
edition = "2021"

[dependencies]
rmp-serde = "1"
serde = { version = "1", features = ["derive"] }

[profile.dev]
debug = false
"""


def section(title: str) -> str:
    """Return the text under a heading, up to the next heading of its level or above."""
    level, _, _ = title.partition(" ")
    pattern = rf"^{re.escape(title)}$(.*?)(?=^#{{1,{len(level)}}} |\Z)"
    found = re.search(pattern, TEXT, re.MULTILINE | re.DOTALL)
    assert found, f"no heading {title!r}"
    return found[1]


def rows(text: str) -> list[list[str]]:
    """Return the cells of all table rows but the headings."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]
    ruled = [number for number, line in enumerate(lines) if set(line) <= {"|", "-"}]
    headings = {number - 1 for number in ruled} | set(ruled)
    return [row for number, row in enumerate(cells) if number not in headings]


def names(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


def code(language: str) -> str:
    """Return the first fenced block of a language."""
    return PAGE.blocks(language)[0]


# Tables against the code


def test_every_topic_is_in_the_document_with_its_encoding_and_nothing_else_is():
    documented = {names(row[0])[0]: names(row[2]) for row in rows(section("## Keys"))}
    known = {topic.key("{ns}", "{camera}"): topic.encoding for topic in TOPICS.values()} | {
        keys.node_key("{ns}", "{node}"): keys.msgpack_of(messages.NodeDescription.schema_name),
        keys.diagnostics_key("{ns}", "{node}"): keys.msgpack_of(messages.Diagnostics.schema_name),
        keys.schema_key("{ns}", "{name}"): keys.JSON,
        keys.parameter_key("{ns}", "{node}", "{name}"): keys.msgpack_of(
            messages.Parameter.schema_name
        ),
        keys.parameters_key("{ns}", "{node}"): keys.msgpack_of(messages.ParameterList.schema_name),
    }
    assert set(documented) == set(known)
    for key, encoding in known.items():
        assert encoding in documented[key], key


def test_the_encodings_of_pixels_are_those_of_the_code():
    documented = [name for row in rows(section("## Pictures")) for name in names(row[0])]
    assert sorted(documented) == sorted(ENCODINGS)


def test_every_reason_for_a_drop_is_in_the_document_and_nothing_else_is():
    raised = r'(?:PayloadError\(\s*|\bdrop\(\s*|\breason=|\bunread=)"(\w+)"'
    sources = [*ROOT.glob("common/**/*.py"), *ROOT.glob("services/**/*.py")]
    in_code = {reason for path in sources for reason in re.findall(raised, path.read_text())}
    documented = rows(section("## What is dropped, and under which name"))
    assert {names(row[0])[0] for row in documented} == in_code
    assert len(documented) == len(in_code)


def test_every_counter_beside_the_balance_is_in_the_document():
    sources = [*ROOT.glob("common/**/*.py"), *ROOT.glob("services/**/*.py")]
    noted = {name for path in sources for name in re.findall(r'\.note\("(\w+)"', path.read_text())}
    assert noted <= set(names(section("### Diagnostics")))


SECTIONS = {
    messages.Header: "## Header",
    messages.Centroid: "### Centroid",
    messages.Tracks: "### Tracks",
    messages.Track: "### Tracks",
    messages.TrackEvent: "### TrackEvent",
    messages.Prediction: "### Prediction",
    messages.Contours: "### Contours",
    messages.Contour: "### Contours",
    messages.CameraInfo: "### CameraInfo",
    messages.Diagnostics: "### Diagnostics",
    messages.Latency: "### Diagnostics",
    messages.Histogram: "### Diagnostics",
    messages.NodeDescription: "### Node",
    messages.Parameter: "### Parameter",
    messages.ParameterList: "### ParameterList",
    messages.Refusal: "### Refusal",
}


@pytest.mark.parametrize("message", SECTIONS, ids=lambda message: message.__name__)
def test_every_field_of_a_message_is_in_its_section(message: type[Message]):
    text = section(SECTIONS[message])
    assert set(message.model_fields) <= set(names(text))
    if message.schema_name and message is not messages.Header:
        assert message.schema_name in names(text)


@pytest.mark.parametrize(
    ("message", "title"),
    [
        (messages.Header, "## Header"),
        (messages.Centroid, "### Centroid"),
        (messages.Track, "### Tracks"),
        (messages.Diagnostics, "### Diagnostics"),
        (messages.Parameter, "### Parameter"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_no_field_is_in_a_table_that_is_not_in_the_message(message: type[Message], title: str):
    documented = [name for row in rows(section(title)) for name in names(row[0])]
    assert set(documented) <= set(message.model_fields)


def test_every_message_has_a_section():
    sent = {
        message
        for message in vars(messages).values()
        if isinstance(message, type) and issubclass(message, Message) and message.schema_name
    }
    assert sent <= set(SECTIONS)


# The four programs against the test vectors


def vectors() -> list[tuple[str, bytes, str]]:
    """Return name, bytes, and what a program must print, of every centroid and header."""
    found = []
    for file in ("centroid.json", "header.json"):
        content = json.loads((VECTORS / file).read_text())
        for row in [*content["vectors"], *content["lenient"]]:
            found.append((row["name"], bytes.fromhex(row["bytes"]), printed(row["map"])))
    return found


def printed(message: dict[str, Any]) -> str:
    header = message.get("header", message)
    lines = [" ".join(str(header[name]) for name in ("camera", "epoch", "seq", "stamp_ns"))]
    if message.get("x") is not None:
        lines.append(f"{message['x']} {message['y']}")
    return "\n".join(lines)


def check(command: list[str], folder: Path) -> None:
    """Run a program over all vectors and compare what it prints."""
    assert vectors()
    for name, payload, expected in vectors():
        file = folder / "payload"
        file.write_bytes(payload)
        done = subprocess.run(
            [*command, str(file)], capture_output=True, text=True, timeout=RUN_S, check=False
        )
        assert done.stdout.strip() == expected, f"{name}: {done.stderr}"
        assert done.returncode == 0


def test_the_python_program_reads_every_vector(tmp_path: Path):
    program = tmp_path / "read_message.py"
    program.write_text(code("python"))
    check([sys.executable, str(program)], tmp_path)


def test_the_c_program_reads_every_vector(tmp_path: Path):
    compiler = need("cc", "gcc")
    source = tmp_path / "read_message.c"
    probe = subprocess.run(
        [compiler, "-x", "c", "-", "-o", tmp_path / "probe", "-lmsgpackc"],
        input="#include <msgpack.h>\nint main(void) { return 0; }\n",
        text=True,
        capture_output=True,
        timeout=BUILD_S,
        check=False,
    )
    if probe.returncode:
        missing("no msgpack-c; Debian package libmsgpack-dev")
    source.write_text(code("c"))
    program = tmp_path / "read_message"
    built = subprocess.run(
        [compiler, "-Wall", "-Wextra", "-Werror", source, "-o", program, "-lmsgpackc"],
        capture_output=True,
        text=True,
        timeout=BUILD_S,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    check([str(program)], tmp_path)


def test_the_javascript_program_reads_every_vector(tmp_path: Path):
    node = need("node", "nodejs")
    program = tmp_path / "read_message.mjs"
    program.write_text(code("javascript"))
    check([node, str(program)], tmp_path)


@pytest.mark.timeout(2 * BUILD_S)
def test_the_rust_program_reads_every_vector(pytestconfig: pytest.Config, tmp_path: Path):
    cargo = shutil.which("cargo")
    if cargo is None:
        pytest.skip("no cargo")
    # What was built stays in pytest's cache: only what the page has changed is built anew.
    project = pytestconfig.cache.mkdir("read_message_in_rust")
    (project / "src").mkdir(exist_ok=True)
    for file, text in (("Cargo.toml", CARGO), ("src/main.rs", code("rust"))):
        (project / file).write_text(text)
    fetched = subprocess.run(
        [cargo, "fetch"],
        cwd=project,
        capture_output=True,
        text=True,
        timeout=BUILD_S,
        check=False,
    )
    if fetched.returncode:
        pytest.skip(f"the crates cannot be had: {fetched.stderr.strip().splitlines()[-1]}")
    built = subprocess.run(
        [cargo, "build", "--offline", "--quiet", "--target-dir", "target"],
        cwd=project,
        capture_output=True,
        text=True,
        timeout=BUILD_S,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    check([str(project / "target" / "debug" / "read_message")], tmp_path)


def test_the_program_for_packed_bits_draws_an_edge_map(tmp_path: Path):
    picture = np.zeros((3, 11), np.uint8)
    picture[0, 0] = picture[1, 8] = picture[2, 10] = 255
    header = messages.Header(camera="front", epoch=1, seq=0, stamp_ns=0, width=11, height=3)
    (tmp_path / "bits").write_bytes(pack_bits(picture))
    (tmp_path / "header").write_bytes(header.to_bytes())
    program = re.search(r"```python\n(.*?)```", section("## Packed bits"), re.DOTALL)
    assert program
    drawn = subprocess.run(
        [sys.executable, "-c", program[1], tmp_path / "bits", tmp_path / "header"],
        capture_output=True,
        text=True,
        timeout=RUN_S,
        check=True,
    )
    assert drawn.stdout.split() == ["#..........", "........#..", "..........#"]
