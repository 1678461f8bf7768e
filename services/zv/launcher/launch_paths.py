"""Finds the files that a launch file names, and checks before anything starts that they exist."""

from __future__ import annotations

from pathlib import Path

from zenoh_vision.config.settings import Settings, local_path
from zenoh_vision.error_text import printable, suggestion
from zenoh_vision.errors import ConfigurationError


def beside(path: Path, place: str, name: str | None) -> str | None:
    """Return the path of a file that the launch file names, relative to itself.

    Raises:
        ConfigurationError: There is no such file; the text begins with ``place``.
    """
    if name is None:
        return None
    found = path.parent / name
    if not found.is_file():
        raise ConfigurationError(f"{place} = {name!r} is not allowed: there is no file {found}")
    return str(found)


def check_paths(place: str, settings: Settings) -> None:
    """Check that all files and folders exist that a service's settings name.

    Without this the service would be started again and again, or wait for its source for ever.

    Raises:
        ConfigurationError: One does not exist; the text begins with ``place``.
    """
    for name in type(settings).model_fields:
        given = getattr(settings, name)
        value = local_path(type(settings), name, given, must_exist=True)
        if value is not None and not Path(value).exists():
            raise ConfigurationError(
                f"{place}: {name}: there is no file or folder "
                f"{printable(str(Path(value).absolute()))}; {_near(Path(value), settings, name)}"
                "a path in a file is relative to that file"
            )


def _near(path: Path, settings: Settings, name: str) -> str:
    """Return a question with the most similar name, or an empty text."""
    try:
        there = [str(each) for each in path.parent.iterdir()]
    except OSError:
        there = []
    default = type(settings).model_fields[name].default
    if isinstance(default, str) and (hint := suggestion(path.name, [default], after="; ")):
        return hint
    return suggestion(str(path), there, after="; ")
