"""The names of a model's classes, and which of them are kept from which score on."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from zenoh_vision.error_text import joined, suggestion
from zenoh_vision.errors import ConfigurationError
from zv.tracker.detector.errors import UnusableModel

MAX_NAMES: Final = 100_000
MAX_CHARACTERS: Final = 64

METADATA: Final = ("names", "classes", "class_names", "labels", "character")
"""Entries of a model's metadata that hold the names, in this order."""

Names = Mapping[int, str]
"""Names by the number of the class."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which classes are kept, and from which score on."""

    least: float  # the least score of classes that have none of their own, 0 to 1
    # The classes that are kept, with their least scores or None; empty for all.
    by_class: Mapping[str, float | None] = field(default_factory=dict)

    def score_of(self, name: str) -> float | None:
        """Return the least score of a class; None if it is not kept."""
        if not self.by_class:
            return self.least
        if name not in self.by_class:
            return None
        own = self.by_class[name]
        return self.least if own is None else own


def names_in(metadata: Mapping[str, str]) -> dict[int, str]:
    """Return the names in a model's metadata; empty if there are none that can be read.

    They are a dictionary or a list in Python's or JSON's form, or separated by commas or lines.
    """
    for key in METADATA:
        text = metadata.get(key, "").strip()
        if not text:
            continue
        for read in (json.loads, ast.literal_eval):
            try:
                value = read(text)
                break
            except (ValueError, SyntaxError, MemoryError, RecursionError):
                value = None
        if isinstance(value, dict):
            entries = [(str(number), name) for number, name in value.items()]
            found = {int(key): _clean(name) for key, name in entries if key.isdecimal()}
        elif isinstance(value, list | tuple):
            found = {number: _clean(name) for number, name in enumerate(value)}
        else:
            found = {number: _clean(name) for number, name in enumerate(re.split(r"[,\n]", text))}
        if found and len(found) <= MAX_NAMES:
            return found
    return {}


def read_names(file: str) -> dict[int, str]:
    """Read a file with one name a line, that of class 0 first; empty lines are classes too.

    Raises:
        UnusableModel: It cannot be read, or has no names.
    """
    try:
        text = Path(file).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise UnusableModel(f"--class-names {file}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise UnusableModel(f"--class-names {file}: is no text in UTF-8") from None
    lines = text.rstrip("\n").split("\n")  # splitlines would end one at a form feed too
    if not text.strip() or len(lines) > MAX_NAMES:
        raise UnusableModel(f"--class-names {file}: one name a line, at most {MAX_NAMES} lines")
    return {number: _clean(line) for number, line in enumerate(lines) if line.strip()}


def name_of(names: Names, number: int) -> str:
    """Return the name of a class; its number as text if it has none."""
    return names.get(number) or str(number)


def check_known(wanted: Wanted, names: Names) -> None:
    """Check that the classes to keep are among those of the model, if their names are known.

    Raises:
        ConfigurationError: One is not; names those that are.
    """
    known = set(names.values())
    for name in wanted.by_class:
        if names and name not in known:
            meant = suggestion(name, known, before="; ")
            raise ConfigurationError(
                f"classes: the model has no class {name!r}{meant}; it has "
                f"{joined(sorted(known), most=100)}"
            )
        if not names and not name.isdecimal():
            raise ConfigurationError(
                f"classes: {name!r}: the model does not say the names of its classes; give them "
                "with --class-names FILE, one a line, or use the numbers of the classes"
            )


def _clean(name: object) -> str:
    """Return a name without control characters or a comma, which separates names in settings."""
    text = "".join(each if each.isprintable() else " " for each in str(name)).replace(",", " ")
    return " ".join(text.split())[:MAX_CHARACTERS]
