"""What typer needs to answer a shell that asks for completions. Loads no command."""

from __future__ import annotations

import os

VARIABLE = "_ZV_COMPLETE"
"""Set by the scripts when they ask for completions; its value says how they want them."""


def answer_shells() -> None:
    """Make typer know the shells: it does so by itself only for options that ``zv`` has not.

    It breaks the help of an option where a terminal of 80 columns would; a shell takes each line
    for one more completion.
    """
    os.environ["COLUMNS"] = "10000"
    from typer.completion import completion_init  # type: ignore[attr-defined]

    completion_init()
