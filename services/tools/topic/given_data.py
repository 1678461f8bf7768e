"""What the user gives ``zv topic pub`` to send: JSON, a file, or standard input."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from common.errors import ConfigurationError, SourceError


def json_of(data: str) -> Any:
    """Return the JSON in a text, in a file, or on standard input.

    Raises:
        ConfigurationError: It is no JSON.
        SourceError: There is no such file.
    """
    if data.lstrip()[:1] in ("{", "["):
        place, text = "DATA", data
    else:
        place, text = data, bytes_of(data).decode(errors="replace")
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigurationError(f"{place}: not JSON: {error}") from None


def bytes_of(data: str) -> bytes:
    """Return what is in a file, or on standard input.

    Raises:
        SourceError: It cannot be read.
    """
    if data == "-":
        return sys.stdin.buffer.read()
    try:
        return Path(data).read_bytes()
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise SourceError(f"{data}: {why}") from None


def tuples(value: Any) -> Any:
    """Return decoded JSON with tuples for lists, as messages have them."""
    if isinstance(value, dict):
        return {name: tuples(each) for name, each in value.items()}
    return tuple(tuples(each) for each in value) if isinstance(value, list) else value
