"""What is printed names no file that someone who installed the wheel does not have."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.support.processes import ROOT

OF_THE_REPOSITORY = re.compile(
    r"\b(docs|examples|tests|benchmarks|configs|services|common)/|\.md\b"
)
GENERATOR = ROOT / "services" / "zv" / "cli" / "generate.py"
"""Writes the repository's own pages, and prints nothing."""

OF_THE_USER = {
    "configs/up.toml",  # used if it is there; named with "of this folder" otherwise
    "launch file; default: configs/up.toml of this folder, or else the built-in one",
    "no folder configs/ here and no file given: nothing to check",
    "configuration files to check: of a service, launch files (.toml), of Zenoh (.json5); "
    "default: those in the folder configs/ here, if there is one",
}
"""What a user may have in the folder that a command is called in."""

FILES = sorted(
    path
    for folder in ("services", "common")
    for path in (ROOT / folder).rglob("*.py")
    if path != GENERATOR
)


def texts(path: Path) -> Iterator[str]:
    """Yield the texts in a file's code, which may be printed: all but docstrings."""
    tree = ast.parse(path.read_text())
    alone = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in alone:
            yield node.value


def test_no_text_names_a_file_of_the_repository():
    assert FILES
    found = [
        (str(path.relative_to(ROOT)), text)
        for path in FILES
        for text in texts(path)
        if OF_THE_REPOSITORY.search(text) and text not in OF_THE_USER
    ]
    assert found == []
