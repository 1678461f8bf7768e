"""Every input that was once a finding of the fuzzer is refused or read; so are the first inputs."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz.mutation import HOW, Mutator
from tests.fuzz.start import corpus_of
from tests.fuzz.targets import SEEDS, TARGETS, seeds
from tests.support.processes import ROOT


@pytest.mark.parametrize("name", TARGETS)
def test_a_target_takes_its_first_inputs_and_those_that_are_cut(name: str):
    for file in corpus_of(name).iterdir():
        data = file.read_bytes()
        for end in {0, 1, len(data) // 2, len(data)}:
            TARGETS[name](data[:end])


@pytest.mark.parametrize("name", HOW)
def test_inputs_that_are_changed_within_their_structure_are_read_or_refused(name: str):
    first = [file.read_bytes() for file in sorted(corpus_of(name).iterdir())]
    mutator = Mutator(name, first, lambda data, _: data)
    made = {mutator(first[number % len(first)], 4096, number) for number in range(600)}
    assert len(made) > 200
    for data in made:
        TARGETS[name](data)


@pytest.mark.parametrize("name", ["rights", "router_answer"])
def test_the_fuzzer_runs(name: str):
    pytest.importorskip("atheris", reason="make fuzz installs it")
    command = [sys.executable, "-m", "tests.fuzz", name, "-runs=2000"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert "Done 2000 runs" in done.stderr


@pytest.mark.parametrize(
    "seed", [each for name in TARGETS for each in seeds(name)], ids=lambda path: path.name
)
def test_a_finding_is_no_more_one(seed: Path):
    TARGETS[seed.parent.name](seed.read_bytes())


def test_the_page_names_every_target():
    page = (SEEDS.parents[2] / "docs" / "testing.md").read_text().partition("## Fuzzing")[2]
    assert set(re.findall(r"`([a-z_]+)`", page)) == set(TARGETS)


def test_every_folder_of_seeds_has_a_target():
    assert {folder.name for folder in SEEDS.iterdir() if folder.is_dir()} <= set(TARGETS)
