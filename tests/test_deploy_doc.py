"""docs/deploy.md is true: its commands run, its file is taken, its arithmetic holds."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import simplejpeg
import zenoh

from common.session import router_config
from common.settings import load_settings
from services.camera.choice import conditions_of
from services.camera.settings import CameraSettings
from services.camera.sources.synthetic import SyntheticSource
from services.catalogue import SERVICES, model_of
from services.cli.options import ConnectionSettings
from tests.processes import ROOT

TEXT = (ROOT / "docs" / "deploy.md").read_text()
QUALITIES = (30, 50, 80, 90, 95)
ROWS = re.findall(r"^\| (\d+)x(\d+) \|((?: \d+ kB, [\d.]+ \|){5})$", TEXT, re.MULTILINE)


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


def commands() -> list[str]:
    return [line for block in blocks("sh") for line in block.splitlines()]


@pytest.mark.parametrize("line", commands())
def test_a_command_has_flags_and_values_that_are_taken(line: str, tmp_path: Path, monkeypatch):
    """Each is run elsewhere: the nodes in test_readme.py, the router with a file below."""
    program, service, *words = shlex.split(line)
    assert program == "zv"
    assert service in SERVICES
    flags = dict(zip(words[::2], words[1::2], strict=True))
    names = {flag.removeprefix("--").replace("-", "_"): value for flag, value in flags.items()}
    common = {
        name: names.pop(name) for name in list(names) if name in ConnectionSettings.model_fields
    }
    load_settings(ConnectionSettings, flags=common)
    load_settings(model_of(service), flags=names)


def test_the_file_for_two_sites_is_one_that_the_router_takes(tmp_path: Path):
    (text,) = blocks("json5")
    file = tmp_path / "site-b.json5"
    file.write_text(text)
    config = router_config("tcp/127.0.0.1:1", str(file))
    assert "tcp/0.0.0.0:7447" in config.get_json("listen/endpoints")
    assert "tcp/192.0.2.1:7447" in config.get_json("connect/endpoints")
    assert isinstance(config, zenoh.Config)


def test_there_are_rows_for_four_sizes():
    assert [(int(width), int(height)) for width, height, _ in ROWS] == [
        (640, 480), (1280, 720), (1920, 1080), (3840, 2160),
    ]  # fmt: skip


@pytest.mark.parametrize(("width", "height", "cells"), ROWS[:3])
def test_the_sizes_are_those_of_the_synthetic_camera_and_the_rates_follow(width, height, cells):
    settings = CameraSettings(width=int(width), height=int(height))
    source = SyntheticSource(
        width=int(width),
        height=int(height),
        seed=settings.seed,
        conditions=lambda: conditions_of(settings),
    )
    pictures = [source.read() for _ in range(3)]
    assert pictures[-1] is not None
    pixels = np.ascontiguousarray(pictures[-1].pixels)
    found = re.findall(r"(\d+) kB, ([\d.]+)", cells)
    for quality, (kilobytes, rate_hz) in zip(QUALITIES, found, strict=True):
        size = len(simplejpeg.encode_jpeg(pixels, quality=quality, colorspace="BGR"))
        assert size / 1000 == pytest.approx(int(kilobytes), rel=0.1)
        assert float(rate_hz) == pytest.approx(1e6 / 8 / (int(kilobytes) * 1000), rel=0.06)


def test_the_variables_are_those_of_env_example():
    example = (ROOT / ".env.example").read_text()
    for name in re.findall(r"`(ZV_[A-Z_]+)(?:=[^`]*)?`", TEXT):
        assert f"#{name}=" in example
