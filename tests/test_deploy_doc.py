"""docs/deploy.md is true: its commands run, its file is taken, its arithmetic holds."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from common.images import encode_jpeg
from common.session import WAIT_BEFORE_CLOSE, router_config
from common.settings import load_settings
from services.camera.choice import conditions_of
from services.camera.settings import CameraSettings
from services.camera.sources.synthetic import SyntheticSource
from services.catalogue import SERVICES, model_of
from services.cli.main import COMMANDS
from services.cli.options import ConnectionSettings
from tests.processes import ROOT

CONNECTION = set(ConnectionSettings.model_fields)
TEXT = (ROOT / "docs" / "deploy.md").read_text()
QUALITIES = (50, 65, 80, 90, 95)
ROWS = re.findall(r"^\| (\d+)x(\d+) \|((?: [\d.]+ kB, [\d.]+ \|){5})$", TEXT, re.MULTILINE)


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


def commands() -> list[str]:
    return [line for block in blocks("sh") for line in block.splitlines()]


NODES = [line for line in commands() if line.split()[:1] == ["zv"] and line.split()[1] in SERVICES]


def test_every_program_of_the_page_is_known_here():
    # What is not ours (sudo, ssh, zenohd ...) is not run by tests; tests/test_systemd.py has the
    # units, tests/integration/test_linked_routers.py the linked routers.
    programs = {line.split()[0] for line in commands()}
    assert programs <= {"zv", "python", "sudo", "ssh", "pip", "journalctl", "zenohd"}
    assert {line.split()[1] for line in commands() if line.startswith("zv ")} <= set(COMMANDS)
    assert len(NODES) >= 4


@pytest.mark.parametrize("line", NODES)
def test_a_node_of_the_page_has_flags_and_values_that_are_taken(line: str):
    _, service, *words = shlex.split(line)
    flags = dict(zip(words[::2], words[1::2], strict=True))
    names = {flag.removeprefix("--").replace("-", "_"): value for flag, value in flags.items()}
    common = {name: names.pop(name) for name in tuple(names) if name in CONNECTION}
    load_settings(ConnectionSettings, flags=common)
    load_settings(model_of(service), flags=names)


def test_the_files_for_routers_are_such_as_a_router_takes(tmp_path: Path):
    texts = blocks("json5")
    assert len(texts) == 2
    for number, text in enumerate(texts):
        file = tmp_path / f"{number}.json5"
        file.write_text(text)
        config = router_config("tcp/127.0.0.1:1", str(file))
        assert "tcp/127.0.0.1:1" in config.get_json("listen/endpoints")
    assert config.get_json(WAIT_BEFORE_CLOSE) == "4000000"  # of the last one, over ours


def test_there_are_rows_for_five_sizes():
    assert [(int(width), int(height)) for width, height, _ in ROWS] == [
        (320, 240), (640, 480), (1280, 720), (1920, 1080), (3840, 2160),
    ]  # fmt: skip


@pytest.mark.parametrize(("width", "height", "cells"), ROWS[:4])
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
    found = re.findall(r"([\d.]+) kB, ([\d.]+)", cells)
    for quality, (kilobytes, rate_hz) in zip(QUALITIES, found, strict=True):
        size = len(encode_jpeg(pixels, "bgr8", quality))
        # The table's are means over many frames.
        assert size / 1000 == pytest.approx(float(kilobytes), rel=0.1)
        assert float(rate_hz) == pytest.approx(1e6 / 8 / (float(kilobytes) * 1060), rel=0.06)
