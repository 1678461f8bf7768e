"""Without the evaluation material the benchmarks say what is missing, and go on."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest

from benchmarks import __main__ as bench
from benchmarks.material import frames


@pytest.fixture(autouse=True)
def _no_material(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ZV_TEST_DATA", str(tmp_path))


def test_frames_are_those_of_the_synthetic_scene(capsys: pytest.CaptureFixture[str]):
    pictures = frames(64, 48)
    assert {each.shape for each in pictures} == {(48, 64, 3)}
    assert "the synthetic scene instead of vtest.avi" in capsys.readouterr().out


def test_the_trackers_pipelines_are_not_measured_but_its_large_cameras_are(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(
        bench.tracker, "large_cameras", lambda _, pipeline, *, edges: f"{pipeline} {edges}"
    )
    bench.measure_tracker(argparse.Namespace(seconds=0.1))
    said = capsys.readouterr().out
    assert "not measured: vtest.avi" in said
    assert "tutorial False" in said
    assert "robust False" in said
    assert "robust True" in said
