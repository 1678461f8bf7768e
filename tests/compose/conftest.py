"""The image built once from a clean clone, and the stacks that tests start from it."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.support.containers.stack import IMAGE, Stack, compose_command, run
from tests.support.containers.witness import Witness
from tests.support.processes import ROOT

SMALL = {"ZV_CAMERA_WIDTH": "320", "ZV_CAMERA_HEIGHT": "240"}
BASES = ("debian:bookworm-slim", "eclipse/zenoh:1.10.2")


@pytest.fixture(scope="session")
def docker() -> None:
    """Skip, saying why, where no containers can be run."""
    if compose_command() is None:
        pytest.skip("no docker with compose")
    if subprocess.run(["docker", "info"], capture_output=True, check=False).returncode:
        pytest.skip("the Docker daemon does not answer")
    if os.geteuid() != 0:
        pytest.skip("root is needed, to look at processes and to make links bad")
    for image in BASES:
        found = subprocess.run(
            ["docker", "image", "inspect", image], capture_output=True, check=False
        )
        pulled = found.returncode and subprocess.run(
            ["docker", "pull", image], capture_output=True, check=False
        )
        if pulled and pulled.returncode:
            pytest.skip(f"the image {image} is not here and cannot be pulled")


@pytest.fixture(scope="session")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a user has: the files that git knows or would take, as they are now."""
    folder = tmp_path_factory.mktemp("clone") / "zenoh-vision"
    names = run("git", "ls-files", "--cached", "--others", "--exclude-standard", cwd=ROOT)
    for name in names.splitlines():
        source, target = ROOT / name, folder / name
        if source.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(source.read_bytes())
            target.chmod(source.stat().st_mode & 0o777)
    folder.chmod(0o755)
    for parent in (folder.parent, folder.parent.parent):
        parent.chmod(0o755)  # the router's user must be able to read its file
    return folder


@pytest.fixture(scope="session")
def image(docker: None, clone: Path) -> str:
    stack = Stack(clone)
    stack.compose("build")
    return IMAGE


@pytest.fixture
def new_stack(image: str, clone: Path) -> Iterator[Callable[..., Stack]]:
    """``new_stack("rest", ZV_CAMERA_RATE="10")`` starts a system; it is removed at the end."""
    with ExitStack() as running:

        def start(*overrides: str | Path, services: tuple[str, ...] = (), **settings: str) -> Stack:
            return running.enter_context(Stack(clone, overrides, settings, services))

        yield start


@pytest.fixture(scope="module")
def stack(image: str, clone: Path) -> Iterator[Stack]:
    """A system with small pictures, shared by the tests of a module.

    At 30 Hz, as by default, but a quarter of the pixels: what these tests break is the network and
    the processes, and a slow machine that cannot keep up with larger pictures drops frames of its
    own. Tests that take ``new_stack`` start it with no settings at all.
    """
    with Stack(clone, settings=SMALL) as running:
        running.wait_until_healthy()
        yield running


@pytest.fixture
def witness(stack: Stack) -> Iterator[Witness]:
    """A client outside that sees the system's streams flow."""
    with Witness(stack.endpoint) as watching:
        watching.flows()
        yield watching
