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

from tests.support.headers import header
from tests.support.processes import ROOT, missing, need, run_program
from tests.support.viewer.pages import Page
from zenoh_vision import keys, messages
from zenoh_vision.image.forms import pack_bits
from zenoh_vision.image.pixel_formats import ENCODINGS
from zenoh_vision.message_codec import Message
from zenoh_vision.topics import TOPICS

PAGE = Page("docs/messages.md")
TEXT = PAGE.text
SOURCES = [
    path.read_text() for folder in ("common", "services") for path in ROOT.glob(f"{folder}/**/*.py")
]
VECTORS = ROOT / "tests" / "vectors"

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
        keys.launch_key("{ns}", "{node}"): "application/msgpack",
        keys.record_key("{ns}", "{node}"): "application/msgpack",
        keys.parameter_key("{ns}", "{node}", "{name}"): keys.msgpack_of(
            messages.Parameter.schema_name
        ),
        keys.parameters_key("{ns}", "{node}"): keys.msgpack_of(messages.ParameterList.schema_name),
        keys.set_key("{ns}", "{node}") + "/{name}": keys.msgpack_of(messages.Parameter.schema_name),
        keys.set_key("{ns}", "{node}"): keys.msgpack_of(messages.ParameterList.schema_name),
    }
    assert set(documented) == set(known)
    for key, encoding in known.items():
        assert encoding in documented[key], key


def test_the_encodings_of_pixels_are_those_of_the_code():
    documented = [name for row in rows(section("## Pictures")) for name in names(row[0])]
    assert sorted(documented) == sorted(ENCODINGS)


def test_every_reason_for_a_drop_is_in_the_document_and_nothing_else_is():
    raised = (
        r'(?:PayloadError\(\s*|\bdrop\(\s*|\breason=|\bunread=|\breason = |\w_missing\(\S+ )"(\w+)"'
    )
    chosen = r'\breason = "\w+" if .* else "(\w+)"'
    found = {each for text in SOURCES for how in (raised, chosen) for each in re.findall(how, text)}
    in_code = found - {"not_made", "not_answered"}  # which are only logged
    documented = rows(section("## What is dropped, and under which name"))
    assert {names(row[0])[0] for row in documented} == in_code
    assert len(documented) == len(in_code)


def test_every_counter_beside_the_balance_is_in_the_document():
    noted = {name for text in SOURCES for name in re.findall(r'\.note\("(\w+)"', text)}
    assert noted <= set(names(section("### Diagnostics")))


SECTIONS = {
    messages.Header: "## Header",
    messages.Centroid: "### Centroid",
    messages.Tracks: "### Tracks",
    messages.Track: "### Tracks",
    messages.TrackEvent: "### TrackEvent",
    messages.Prediction: "### Prediction",
    messages.Replay: "### Replay",
    messages.ReplayMark: "### Replay",
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


ONE_TABLE = (
    messages.Header,
    messages.Centroid,
    messages.Track,
    messages.Diagnostics,
    messages.Parameter,
)
"""Messages whose sections have no table but that of their fields."""


@pytest.mark.parametrize("message", SECTIONS, ids=lambda message: message.__name__)
def test_the_fields_of_a_message_are_in_its_section(message: type[Message]):
    text = section(SECTIONS[message])
    fields = {field.alias or name for name, field in message.model_fields.items()}
    assert fields <= set(names(text))
    if message.schema_name and message is not messages.Header:
        assert message.schema_name in names(text)
    if message in ONE_TABLE:
        documented = [name for row in rows(text) for name in names(row[0])]
        assert set(documented) <= fields


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


def check(command: list[object], folder: Path) -> None:
    """Run a program over all vectors and compare what it prints."""
    assert vectors()
    for name, payload, expected in vectors():
        (folder / "payload").write_bytes(payload)
        done = run_program([*command, folder / "payload"])
        assert (done.stdout.strip(), done.returncode) == (expected, 0), f"{name}: {done.stderr}"


@pytest.mark.parametrize(("language", "end"), [("python", "py"), ("javascript", "mjs")])
def test_a_program_without_a_compiler_reads_every_vector(language: str, end: str, tmp_path: Path):
    program = tmp_path / f"read_message.{end}"
    program.write_text(code(language))
    check([sys.executable if end == "py" else need("node", "nodejs"), program], tmp_path)


def test_the_c_program_reads_every_vector(tmp_path: Path):
    compile_it = [need("cc", "gcc"), "-Wall", "-Wextra", "-Werror", "-o", tmp_path / "program"]
    text = "#include <msgpack.h>\nint main(void) { return 0; }\n"
    if run_program([*compile_it, "-x", "c", "-", "-lmsgpackc"], typed=text).returncode:
        missing("no msgpack-c; Debian package libmsgpack-dev")
    (tmp_path / "source.c").write_text(code("c"))
    built = run_program([*compile_it, tmp_path / "source.c", "-lmsgpackc"])
    assert built.returncode == 0, built.stderr
    check([tmp_path / "program"], tmp_path)


@pytest.mark.timeout(600)
def test_the_rust_program_reads_every_vector(pytestconfig: pytest.Config, tmp_path: Path):
    cargo = shutil.which("cargo")
    if cargo is None:
        pytest.skip("no cargo")
    # What was built stays in pytest's cache: only what the page has changed is built anew.
    project = pytestconfig.cache.mkdir("read_message_in_rust")
    (project / "src").mkdir(exist_ok=True)
    for file, text in (("Cargo.toml", CARGO), ("src/main.rs", code("rust"))):
        (project / file).write_text(text)

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [cargo, *words], cwd=project, capture_output=True, text=True, check=False
        )

    fetched = run("fetch")
    if fetched.returncode:
        pytest.skip(f"the crates cannot be had: {fetched.stderr.strip().splitlines()[-1]}")
    built = run("build", "--offline", "--quiet", "--target-dir", "target")
    assert built.returncode == 0, built.stderr
    check([str(project / "target" / "debug" / "read_message")], tmp_path)


def test_the_program_for_packed_bits_draws_an_edge_map(tmp_path: Path):
    picture = np.zeros((3, 11), np.uint8)
    picture[0, 0] = picture[1, 8] = picture[2, 10] = 255
    (tmp_path / "bits").write_bytes(pack_bits(picture))
    (tmp_path / "header").write_bytes(header(width=11, height=3).to_bytes())
    program = re.search(r"```python\n(.*?)```", section("## Packed bits"), re.DOTALL)
    assert program
    drawn = run_program([sys.executable, "-c", program[1], tmp_path / "bits", tmp_path / "header"])
    assert drawn.stdout.split() == ["#..........", "........#..", "..........#"]
