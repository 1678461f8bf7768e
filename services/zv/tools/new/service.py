"""``zv new service``: writes a service of your own with settings, loop, launch file and test."""

from __future__ import annotations

import importlib.util
import keyword
import shlex
import shutil
import sys
from importlib import resources
from pathlib import Path
from string import Template

from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.topics import TOPICS
from zenoh_vision.transport.connection import Connection
from zv.registry import SERVICES
from zv.tools.new.options import ServiceOptions
from zv.tools.shared.output import Output

MOST_WIDTH = 40
"""Longer commands do not widen the column."""

FILES = {
    "service.py.template": "$name.py",
    "launch.toml.template": "launch.toml",
    "test_service.py.template": "test_$name.py",
}
"""The files of the folder ``template``, and their names in the new folder."""


def run(options: ServiceOptions, connection: Connection, output: Output) -> None:
    """Write the folder; print its files and the next steps.

    Raises:
        ConfigurationError: The name is taken, or the folder exists.
        SourceError: The folder or a file cannot be written.
    """
    name = options.name
    folder = Path(options.folder or name)
    if folder.exists() or folder.is_symlink():
        raise ConfigurationError(
            f"{folder} exists already, and nothing is overwritten; give another NAME or --folder"
        )
    check_name(name)
    try:
        written = write(name, folder)
    except OSError as error:
        raise SourceError(f"{error.filename or folder}: {error.strerror or error}") from None
    python = _python()
    commands = {
        f"{python} -m pip install pytest": "is needed once, unless pytest is there",
        f"{python} -m pytest": "runs its test",
        "zv up launch.toml": "starts it, with a router, a camera and the viewer",
        f"{python} {name}.py --help": "shows its options",
        f"zv security add --node {name}_front --publishes {connection.namespace}/front/{name} "
        f"--subscribes {connection.namespace}/front/image/compressed": "gives it a certificate, "
        "in a system that has some",
    }
    width = max(len(command) for command in commands if len(command) < MOST_WIDTH)
    output.result(
        {"folder": str(folder), "files": [path.name for path in written]},
        f"wrote {', '.join(map(str, written))}",
        "next:",
        f"  cd {shlex.quote(str(folder))}",
        *(f"  {command:{width}}  {words}" for command, words in commands.items()),
    )


def check_name(name: str) -> None:
    """Check that the name of a service is not taken.

    Raises:
        ConfigurationError: It is taken; the text says by what.
    """
    taken = ""
    if name in SERVICES:
        taken = "is a service of zv"
    elif name in {topic.split("/")[0] for topic in TOPICS}:
        taken = "begins the key of a topic of zv"
    elif keyword.iskeyword(name):
        taken = "is a word of Python's grammar"
    elif _is_module(name):
        taken = "is a module of Python or an installed one, which its file would hide"
    if taken:
        raise ConfigurationError(f"NAME = {name!r} is not allowed: it {taken}; give another name")


def write(name: str, folder: Path) -> list[Path]:
    """Write the files of a service, or none; return their paths.

    Raises:
        OSError: The folder exists, or something cannot be written.
    """
    words = {
        "name": name,
        "variable": name.upper(),
        "message": "".join(part.capitalize() for part in name.split("_")),
    }
    templates = resources.files("zv.tools.new") / "template"
    folder.mkdir(parents=True)
    written = []
    try:
        for template, named in FILES.items():
            path = folder / Template(named).substitute(words)
            text = (templates / template).read_text(encoding="utf-8")
            path.write_text(Template(text).substitute(words), encoding="utf-8")
            written.append(path)
    except OSError:
        shutil.rmtree(folder, ignore_errors=True)  # it would be refused the next time
        raise
    return written


def _python() -> str:
    """Return the command of the Python that has this library; with pipx, it is not on the path."""
    found = shutil.which("python")
    ours = Path(sys.executable)
    if found is not None and Path(found).parent.resolve() == ours.parent.resolve():
        return "python"
    return shlex.quote(str(ours))


def _is_module(name: str) -> bool:
    found = importlib.util.find_spec(name)
    return found is not None and found.origin is not None  # a folder of this name is not a module
