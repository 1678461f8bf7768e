"""What the typist runs is what one would get who types it."""

from __future__ import annotations

import sys

import pytest

from tests.support.processes import run_program
from tests.support.typist import type_zv


@pytest.mark.parametrize(
    "arguments",
    [["schema", "Centroid"], ["trakker"], ["edge", "--sigma", "99"], ["top", "--help"]],
    ids=" ".join,
)
def test_a_typed_command_is_what_a_new_interpreter_makes_of_it(arguments: list[str]):
    typed = type_zv(arguments)
    begun = run_program([sys.executable, "-m", "zv", *arguments])
    assert (typed.returncode, typed.stdout, typed.stderr) == (
        begun.returncode,
        begun.stdout,
        begun.stderr,
    )


def test_folder_and_environment_are_those_that_are_given(tmp_path):
    (tmp_path / "edge.toml").write_text("sigma = 99\n")
    assert (
        "edge.toml: sigma = 99"
        in type_zv(["edge", "--config", "edge.toml"], folder=tmp_path).stderr
    )
    assert "ZV_EDGE_SIGMA = '98'" in type_zv(["edge"], ZV_EDGE_SIGMA="98").stderr
    assert "98" not in type_zv(["edge", "--sigma", "97"]).stderr


def test_a_command_that_does_not_end_is_ended():
    with pytest.raises(AssertionError, match=r"no end within 0\.5 s"):
        type_zv(["tracker", "--connect", "tcp/127.0.0.1:1"], timeout_s=0.5)
    assert type_zv(["schema"]).returncode == 0
