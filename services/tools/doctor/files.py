"""Checks of configuration files: services' options, launch files, Zenoh's own."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import zenoh

from common.errors import ConfigurationError
from common.settings import load_settings, read_toml
from common.zenoh_config import plain
from services.catalogue import SERVICES, model_of
from services.launch_file import read_launch_file
from services.tools.doctor.finding import Finding

FOLDER = Path("configs")
LAUNCH = "launch file"
ZENOH = (".json5", ".json", ".yaml", ".yml")
IN_JSON = re.compile(r'msg: "(?P<message>.*)", location: Some\(Location \{ line: (?P<line>\d+)')
SHOWN = 80
SHM = "transport/shared_memory/enabled"
CORRECT = "correct it; zv COMMAND --help and docs/configuration.md have all options"


def file_findings(given: Sequence[str], zenoh_config: str | None = None) -> Iterator[Finding]:
    """Check files as the commands that read them would.

    Args:
        given: Paths; none: all of ``configs/``.
        zenoh_config: The file of ``--zenoh-config``, if any.
    """
    yield from environment_findings()
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
        yield Finding("OK", "files", "no folder configs/ here and no file named: nothing to check")


def environment_findings() -> Iterator[Finding]:
    """Check the variables that set options of services."""
    for service in SERVICES:
        try:
            load_settings(model_of(service))
        except ConfigurationError as error:
            yield Finding("FAIL", "files", str(error), "correct or unset the variable")


def toml_findings(path: Path) -> Iterator[Finding]:
    """Check a TOML file; nothing is found if it is right."""
    try:
        values = read_toml(path)
        kind = kind_of(path, values)
        if kind == LAUNCH:
            read_launch_file(path)
        else:
            load_settings(model_of(kind), config=path)
    except ConfigurationError as error:
        if not str(error).startswith("environment: "):  # is said once for all files
            yield Finding("FAIL", "files", str(error), CORRECT)


def kind_of(path: Path, values: dict[str, Any]) -> str:
    """Return the service whose options a file has, or that it is a launch file.

    Raises:
        ConfigurationError: It is none of them.
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
    """Check a configuration file of Zenoh's; nothing is found if it is right."""
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
            "transport: { shared_memory: { enabled: false } }; zv's own programs switch it off "
            "themselves, zenohd and others do not",
        )


def explained(error: zenoh.ZError, path: Path) -> str:
    """Return what Zenoh says of a file, with the line that it means."""
    said = " ".join(plain(error).split())
    found = IN_JSON.search(said)
    if found is None:
        return said
    number = int(found["line"])
    line = path.read_text(errors="replace").splitlines()[number - 1].strip()
    return f"line {number}, {line[:SHOWN]!r}: {found['message']}"
