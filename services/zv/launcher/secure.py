"""The certificates of a launched system: those of its router and of each of its nodes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.security.credentials import SUFFIX, credentials_file, read_credentials


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
    def of(cls, folder: str, nodes: Iterable[str], namespace: str) -> Self:
        """Find and check the files of a folder, before anything is started.

        Args:
            folder: The folder.
            nodes: Names of the nodes that need certificates.
            namespace: That of the nodes.

        Raises:
            SourceError: One is missing or cannot be read.
            ConfigurationError: One cannot be used, or is for another namespace.
        """
        path = Path(folder).absolute()
        if not path.is_dir():
            raise SourceError(f"--secure {folder}: no such folder; zv security init makes it")
        found = {name: _own(path, name, namespace) for name in nodes}
        router = credentials_file(str(path / "router"))
        return cls(router, found, _own(path, "launcher", namespace))


def _own(folder: Path, name: str, namespace: str) -> Path:
    if not (folder / f"{name}{SUFFIX}").is_file():
        _, _, camera = name.partition("_")
        add = f"--camera {camera}" if camera else f"--node {name}"
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
