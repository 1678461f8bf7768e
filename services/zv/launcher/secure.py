"""The certificates of a launched system: those of its router and of each of its nodes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.security.credentials import SUFFIX, credentials_file, read_credentials
from zv.launcher.launch_file import Planned, PlannedProgram


@dataclass(frozen=True, slots=True)
class SecureFiles:
    """Files of ``zv security``.

    Attributes:
        router: Configuration of the router.
        nodes: Credentials by the name of a node.
        launcher: Credentials of ``zv up`` itself, which sees all nodes and answers for them.
    """

    router: Path
    nodes: Mapping[str, Path]
    launcher: Path

    @classmethod
    def of(cls, folder: str, nodes: Iterable[Planned], namespace: str) -> Self:
        """Find and check the files of a folder, before anything is started.

        Raises:
            SourceError: One is missing or cannot be read.
            ConfigurationError: One cannot be used, or is for another namespace.
        """
        path = Path(folder).absolute()
        if not path.is_dir():
            raise SourceError(f"--secure {folder}: no such folder; zv security init makes it")
        found = {node.name: _own(path, node.name, namespace, _named(node)) for node in nodes}
        router = credentials_file(str(path / "router"))
        return cls(router, found, _own(path, "launcher", namespace, "--node launcher"))


def _named(node: Planned) -> str:
    """Return how zv security add is told of a node that is not known to it."""
    if isinstance(node, PlannedProgram) or getattr(node.settings, "to", False):
        return f"--node {node.name} --publishes KEY --subscribes KEY"
    if node.name == node.service:
        cameras: tuple[str, ...] = getattr(node.settings, "cameras", ())
        return " ".join((f"--node {node.name}", *(f"--camera {each}" for each in cameras)))
    return f"--camera {node.name.removeprefix(f'{node.service}_')}"


def _own(folder: Path, name: str, namespace: str, add: str) -> Path:
    if not (folder / f"{name}{SUFFIX}").is_file():
        raise SourceError(
            f"{folder / name}{SUFFIX}: no such file; the node {name} has no certificate: "
            f"zv security add {add} --dir {folder}"
        )
    found = read_credentials(str(folder / name))
    if found.namespace != namespace:
        raise ConfigurationError(
            f"{found.path}: its rights are in namespace {found.namespace}, but the nodes are in "
            f"{namespace}; allowed: --namespace {found.namespace}"
        )
    return found.path
