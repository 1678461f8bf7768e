"""The recipes of docs/architecture.md hold: each addition takes the edits that stand there."""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path

import pytest
import zenoh

from tests.support.listening import ask, open_client, wait_for_nodes
from tests.support.processes import ROOT, START_S, Program, run_program
from tests.support.systems import system

SETTINGS = '''"""The blur's options."""

from typing import Annotated, ClassVar

from pydantic import Field

from zenoh_vision import Live, ServiceSettings


class BlurSettings(ServiceSettings):
    """Options of the blur."""

    env_prefix: ClassVar[str] = "ZV_BLUR_"

    sigma: Annotated[float, Field(gt=0, le=50, description="of the Gaussian"), Live("pixels")] = 2.0
'''
SERVICE = '''"""The blur's loop."""

import cv2

from zenoh_vision import Connection, Node
from zv.blur.settings import BlurSettings
from zv.registry import published_by


def run(settings: BlurSettings, connection: Connection) -> None:
    """Publish each frame blurred."""
    with Node(
        "blur",
        camera=settings.camera,
        connection=connection,
        publishes=published_by("blur"),
        parameters=settings,
    ) as node:
        for frame in node.frames("image/compressed"):
            sigma = frame.revision.settings.sigma
            blurred = cv2.GaussianBlur(frame.bgr, (0, 0), sigma)
            node.publish_picture("blurred/compressed", blurred, frame=frame)
'''
ENTRY = """    "blur": Service(
        "zv.blur.settings:BlurSettings",
        "Publish each frame blurred.",
        "zv blur --camera front --sigma 3",
        publishes=("blurred/compressed",),
        consumes=("image/compressed",),
    ),
    "edge": Service("""


class Copy:
    """A copy of the repository to which the recipes are applied."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in ("common", "services", "configs", "docs"):
            shutil.copytree(ROOT / name, folder / name)
        for name in ("pyproject.toml", "docker-compose.yml"):
            shutil.copy(ROOT / name, folder)
        self.path = f"{folder / 'common'}{os.pathsep}{folder / 'services'}"

    def edit(self, file: str, old: str, new: str) -> None:
        """Make one edit: ``old`` stands there exactly once."""
        path = self.folder / file
        text = path.read_text()
        assert text.count(old) == 1, (file, old)
        path.write_text(text.replace(old, new))

    def run(self, *command: object, fails: bool = False) -> str:
        done = run_program([sys.executable, *command], folder=self.folder, PYTHONPATH=self.path)
        assert (done.returncode != 0) == fails, done.stdout + done.stderr
        return done.stdout + done.stderr


@pytest.fixture(scope="module")
def extended(tmp_path_factory: pytest.TempPathFactory) -> Copy:
    """The copy with one more service, topic, message, field and setting."""
    copy = Copy(tmp_path_factory.mktemp("repository"))
    # A service: a folder, an entry, a name in the contract.
    blur = copy.folder / "services/zv/blur"
    blur.mkdir()
    (blur / "__init__.py").write_text('"""The blur."""\n')
    (blur / "settings.py").write_text(SETTINGS)
    (blur / "service.py").write_text(SERVICE)
    copy.edit("services/zv/registry.py", '    "edge": Service(', ENTRY)
    # A topic: one row.
    row = '        Topic("background/compressed", JPEG, recorded=False),\n'
    copy.edit(
        "common/zenoh_vision/topics.py", row, row + '        Topic("blurred/compressed", JPEG),\n'
    )
    # A message: one class. A field: one line. A setting: one field.
    copy.edit(
        "common/zenoh_vision/messages.py",
        "class Latency(Message):",
        'class Sharpness(Stamped):\n    """How sharp one frame is."""\n\n'
        '    schema_name: ClassVar[str] = "vision.Sharpness.v1"\n\n    value: float\n\n\n'
        "class Latency(Message):",
    )
    copy.edit(
        "common/zenoh_vision/messages.py",
        "    event: Annotated[str, Field(max_length=64)]\n    id: Count\n",
        "    event: Annotated[str, Field(max_length=64)]\n    id: Count\n"
        "    confidence: float = 1.0\n",
    )
    copy.edit(
        "services/zv/edge/settings.py",
        '    env_prefix: ClassVar[str] = "ZV_EDGE_"\n',
        '    env_prefix: ClassVar[str] = "ZV_EDGE_"\n\n'
        '    border: Annotated[int, Field(ge=0, le=99, description="not searched"), Live()] = 0\n',
    )
    return copy


def test_a_service_without_its_name_in_the_contract_is_found_and_with_it_all_layers_hold(extended):
    lint = Path(sys.executable).with_name("lint-imports")
    assert "zv.blur" in extended.run(lint, "--no-cache", fails=True)
    extended.edit("pyproject.toml", "camera | tracker |", "blur | camera | tracker |")
    assert "0 broken" in extended.run(lint, "--no-cache")


def test_command_flags_and_configuration_files_follow_from_the_entry(extended):
    assert "zv blur --camera front --sigma 3" in extended.run("-m", "zv", "blur", "--help")
    assert "Publish each frame blurred." in extended.run("-m", "zv", "--help")
    extended.run("-m", "docs.generate")
    assert "sigma = 2.0" in (extended.folder / "configs/blur.toml").read_text()
    assert "border = 0" in (extended.folder / "configs/edge.toml").read_text()
    assert "ZV_EDGE_BORDER" in (extended.folder / "docker-compose.yml").read_text()
    assert "--border" in extended.run("-m", "zv", "edge", "--help")


def test_the_schema_of_a_message_and_of_a_field_is_known(extended):
    assert "value" in extended.run("-m", "zv", "schema", "Sharpness")
    schema = json.loads(extended.run("-m", "zv", "schema", "TrackEvent"))
    assert schema["properties"]["confidence"]["default"] == 1.0


def test_the_service_runs_publishes_and_has_its_parameters(extended, tmp_path):
    with system(tmp_path) as endpoint, open_client(endpoint) as session:
        command = ["-m", "zv", "blur", "--connect", endpoint]
        with Program(
            command, tmp_path, "blur", cwd=extended.folder, PYTHONPATH=extended.path
        ) as blur:
            wait_for_nodes(session, "camera_front", "blur_front", deadline_s=START_S)
            pictures = zenoh.handlers.RingChannel(2)  # a full FIFO blocks the session
            subscriber = session.declare_subscriber("vision/front/blurred/compressed", pictures)
            assert subscriber.recv().payload.to_bytes().startswith(b"\xff\xd8\xff")
            (parameter,) = ask(session, "@vision/param/blur_front/sigma")
            assert (parameter.body["value"], parameter.body["unit"]) == (2.0, "pixels")
            assert blur.interrupt() == 0
