"""Checks of this machine: configuration files, environment variables, video devices."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import zenoh

from zenoh_vision.cli.flags import connection_from
from zenoh_vision.config.settings import CONNECTION, load_settings, read_config
from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.host.video_devices import GIVE_ACCESS, describe, device_nodes
from zenoh_vision.transport.zenoh_config import credentials_of, zenoh_error_text
from zv.launcher.launch_file import read_launch_file
from zv.registry import SERVICES, model_of
from zv.tools.doctor.finding import Finding

FOLDER = Path("configs")
LAUNCH = "launch file"
ZENOH = (".json5", ".json", ".yaml", ".yml")
IN_JSON = re.compile(r'msg: "(?P<message>.*)", location: Some\(Location \{ line: (?P<line>\d+)')
SHM = "transport/shared_memory/enabled"
CORRECT = "correct it; zv COMMAND --help shows all options"


def file_findings(given: Sequence[str], zenoh_config: str | None = None) -> Iterator[Finding]:
    """Check files, by default those of ``configs/``, like the commands that read them."""
    for service in SERVICES:
        try:
            load_settings(model_of(service))
        except ConfigurationError as error:
            yield Finding("FAIL", "files", str(error), "correct or unset the variable")
    paths = [Path(path) for path in given]
    if not paths and FOLDER.is_dir():
        paths = sorted([*FOLDER.glob("*.toml"), *FOLDER.glob("*.json5")])
    if zenoh_config is not None and Path(zenoh_config) not in paths:
        paths.append(Path(zenoh_config))
    good = []
    for path in paths:
        found = list(zenoh_findings(path) if path.suffix in ZENOH else toml_findings(path))
        yield from found
        if not found:
            good.append(str(path))
    if good:
        yield Finding("OK", "files", f"right: {', '.join(good)}")
    elif not paths:
        yield Finding("OK", "files", "no folder configs/ here and no file given: nothing to check")


def toml_findings(path: Path) -> Iterator[Finding]:
    """Check a TOML file; yield nothing if it is valid."""
    try:
        values, connection = read_config(path)
        kind = kind_of(path, values)
        if kind == LAUNCH:
            read_launch_file(path)
            return
        load_settings(model_of(kind), config=path)
        if connection:
            _check_connection(path)
    except (ConfigurationError, SourceError) as error:
        if not str(error).startswith("environment: "):  # reported once for all files
            yield Finding("FAIL", "files", str(error), CORRECT)


def _check_connection(path: Path) -> None:
    connection = connection_from({}, config=path)
    try:
        credentials_of(connection)
    except (ConfigurationError, SourceError) as error:
        raise ConfigurationError(f"{path}: [{CONNECTION}]: {error}") from None


def kind_of(path: Path, values: dict[str, Any]) -> str:
    """Return the service whose options a file holds, or ``LAUNCH`` for a launch file.

    Raises:
        ConfigurationError: It has neither.
    """
    if "node" in values or path.stem == "up":
        return LAUNCH
    named = [service for service in SERVICES if service in path.stem.replace("-", "_").split("_")]
    if len(named) == 1:
        return named[0]
    known = {service: len(values.keys() & model_of(service).model_fields) for service in SERVICES}
    best = max(known, key=lambda service: known[service])
    if not known[best] and values:
        raise ConfigurationError(
            f"{path}: {', '.join(values)}: options of no service; allowed: those of "
            f"{', '.join(SERVICES)}, or [[node]] tables of a launch file"
        )
    return best


def zenoh_findings(path: Path) -> Iterator[Finding]:
    """Check a configuration file of Zenoh; yield nothing if it is valid."""
    if not path.is_file():
        yield Finding("FAIL", "files", f"{path}: no such file", "name another")
        return
    try:
        config = zenoh.Config.from_file(path)
        shared = json.loads(config.get_json(SHM))
    except zenoh.ZError as error:
        yield Finding("FAIL", "files", f"{path}: {explained(error, path)}", "correct it")
        return
    if shared:
        yield Finding(
            "WARN",
            "memory",
            f"{path} leaves shared memory on, as Zenoh does by default ({SHM}): it leaks locked "
            "memory in the router (zenoh #2787)",
            "transport: { shared_memory: { enabled: false } }; the commands of zv switch it off, "
            "zenohd and other programs do not",
        )


def explained(error: zenoh.ZError, path: Path) -> str:
    """Return Zenoh's error about a file, with the line that is wrong."""
    said = " ".join(zenoh_error_text(error).split())
    found = IN_JSON.search(said)
    if found is None:
        return said
    number = int(found["line"])
    line = path.read_text(encoding="utf-8", errors="replace").splitlines()[number - 1].strip()
    return f"line {number}, {line[:80]!r}: {found['message']}"


def device_findings(root: Path = Path("/")) -> Iterator[Finding]:
    """Check the access to video devices, where ``root`` holds ``dev`` and ``sys``."""
    nodes = device_nodes(root)
    if not nodes:
        said = "this machine has no video device (/dev/video*)"
        yield Finding("OK", "devices", f"{said}; synthetic, files, folders and URLs need none")
    for node in nodes:
        device = describe(node, root)
        if os.access(node, os.R_OK | os.W_OK):
            yield Finding("OK", "devices", f"{device} can be read and written")
        else:
            said = f"{device}: permission is missing to read and write it"
            remedy = f"join its group: {GIVE_ACCESS}, then log in again"
            yield Finding("WARN", "devices", said, remedy)
