"""The command line, environment and working directory of each process of a launch file."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from zenoh_vision.config.settings import Secret, Settings, flag_of, from_environment
from zenoh_vision.error_text import shortened, without_password
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.host import health_file
from zenoh_vision.transport.connection import Connection
from zv.registry import command_of

CREDENTIALS = "ZV_CREDENTIALS"
RESOLVED = (
    "ZV_CONNECT",
    "ZV_NAMESPACE",
    "ZV_ZENOH_CONFIG",
    CREDENTIALS,
    "ZV_TIMEOUT",
    health_file.VARIABLE,
)
"""Variables that children do not inherit: services get their values as flags if needed.

Only ``zv up`` itself writes the health file, for all of them.
"""

ROOT = Path(__file__).parent.parent.parent

OptionValue = str | int | float | bool


@dataclass(frozen=True, slots=True)
class CommandLine:
    """How a process is started.

    Attributes:
        words: The program and its arguments.
        environment: All its variables.
        folder: Its working directory; None for the one of ``zv up``.
    """

    words: tuple[str, ...]
    environment: Mapping[str, str] = field(repr=False)
    folder: Path | None = None


def zv_command_line(
    words: Sequence[str], variables: Mapping[str, str] | None = None
) -> CommandLine:
    """Return the command line that starts a command of ``zv`` with this interpreter.

    ``variables`` are added to the inherited environment.
    """
    environment = _without_resolved()
    if ROOT.name not in ("site-packages", "dist-packages"):  # a checkout, perhaps not installed
        environment["PYTHONPATH"] = os.pathsep.join(
            part for part in (str(ROOT), os.environ.get("PYTHONPATH")) if part
        )
    # -P: do not import from a folder named zv in the working directory.
    return CommandLine(
        (sys.executable, "-P", "-m", "zv", *words), {**environment, **(variables or {})}
    )


def service_flags(service: str, settings: Settings) -> tuple[list[str], dict[str, str]]:
    """Return the arguments of ``zv`` that give a service its settings, and its secret variables.

    Defaults are left out unless the inherited environment has another value. Secrets are passed in
    the environment, since everyone on a machine can read the command lines of all processes.
    """
    flags = [command_of(service)]
    secrets: dict[str, str] = {}
    model = type(settings)
    inherited = from_environment(model)
    for name, option in model.model_fields.items():
        value = getattr(settings, name)
        if value is None or (value == option.default and name not in ("camera", *inherited)):
            continue
        flag = flag_of(name)
        if isinstance(value, bool):
            flags.append(flag if value else f"--no-{flag[2:]}")
        elif isinstance(value, Mapping):
            flags += [flag, json.dumps(dict(value))]
        elif Secret in map(type, option.metadata) or without_password(str(value)) != str(value):
            secrets[f"{model.env_prefix}{name.upper()}"] = str(value)
        else:
            flags += [flag, str(value)]
    return flags, secrets


def program_flags(options: Mapping[str, OptionValue | Sequence[OptionValue]]) -> list[str]:
    """Return options as arguments of any program.

    ``{"gain": 2.0, "loop": True, "zone": ["a", "b"]}`` becomes ``--gain=2.0 --loop --zone=a
    --zone=b``, and False becomes ``--no-loop``. The ``=`` keeps a value that begins with a dash
    from being read as another flag.
    """
    flags = []
    for name, value in options.items():
        flag = flag_of(name)
        for each in value if isinstance(value, list | tuple) else [value]:
            if isinstance(each, bool):
                flags.append(flag if each else f"--no-{flag[2:]}")
            else:
                flags.append(f"{flag}={each}")
    return flags


def program_command_line(
    node: str,
    words: Sequence[str],
    variables: Mapping[str, str],
    folder: Path,
    connection: Connection,
) -> CommandLine:
    """Return the command line of a program that is no command of ``zv``.

    ``variables`` are those of the launch file, which override all others.
    """
    environment = {
        "PYTHONUNBUFFERED": "1",  # otherwise its lines would appear only when its buffer is full
        **_without_resolved(),
        "PATH": search_path(),
        "ZV_NODE": node,
        "ZV_CONNECT": connection.connect,
        "ZV_NAMESPACE": connection.namespace,
    }
    if connection.zenoh_config:
        environment["ZV_ZENOH_CONFIG"] = str(Path(connection.zenoh_config).absolute())
    return CommandLine(tuple(words), {**environment, **variables}, folder)


def search_path() -> str:
    """Return the PATH for programs, on which ``python`` and ``zv`` are of this installation.

    An active virtual environment goes first, as in the shell where it was activated.
    """
    path = os.environ.get("PATH", os.defpath)
    if os.environ.get("VIRTUAL_ENV"):
        return path
    return f"{Path(sys.executable).parent}{os.pathsep}{path}"


def found_program(word: str, path: str, folder: Path) -> str:
    """Return the path of a program, found as by a shell whose working directory is ``folder``.

    Raises:
        ConfigurationError: There is none, or it cannot be executed.
    """
    if os.sep not in word:
        found = shutil.which(word, path=path)
        if found is None:
            raise ConfigurationError(f"there is no program {shortened(word)} on PATH")
        return str(Path(found).absolute())
    program = folder / word
    if not program.is_file():
        raise ConfigurationError(f"there is no file {program}")
    if not os.access(program, os.X_OK):
        raise ConfigurationError(f"{program} is not executable")
    return str(program)


def _without_resolved() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name not in RESOLVED}
