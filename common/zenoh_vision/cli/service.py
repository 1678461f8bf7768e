"""Makes the command of a service, built-in or your own, from its loop and its settings."""

from __future__ import annotations

import gc
import inspect
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from zenoh_vision.cli.command import Command, run_command
from zenoh_vision.cli.errors import exit_with_status, leave_on_signals, log_to_stderr
from zenoh_vision.cli.flags import (
    CONFIG,
    ConnectionSettings,
    connection_from,
    parameters_of,
    sections,
)
from zenoh_vision.cli.processors import ProcessorSettings
from zenoh_vision.config.settings import CONNECTION, Settings, load_settings
from zenoh_vision.host.lifeline import end_with_parent
from zenoh_vision.transport.connection import Connection

S = TypeVar("S", bound=Settings)

TAKEN = (
    *("config", "debug", "help", CONNECTION),
    *ConnectionSettings.model_fields,
    *ProcessorSettings.model_fields,
)
"""Names of flags that every service has, and of the table in every service's file."""

DOCSTRING_SECTION = re.compile(r"\n\s*\n(Args|Attributes|Raises|Returns):\n.*", re.DOTALL)


def service_command(
    name: str,
    model: type[S],
    load: Callable[[], Callable[[S, Connection], object]],
    text: str,
    examples: Sequence[str],
    *,
    alone: tuple[type[Settings], Callable[[S, Settings], object]] | None = None,
) -> Command:
    """Return the command that reads a service's settings and runs its loop.

    Args:
        name: The last word that calls it.
        model: The settings: each is a flag, an environment variable and a key of ``--config``.
        load: Returns the loop, which is called with the settings and the connection; what it needs
            is imported then, not for ``--help``.
        text: What it does, in paragraphs; its first line is the summary.
        examples: Command lines.
        alone: Further flags, and the function that is called with the settings and these flags,
            instead of the loop, if one of them is given. It needs no router.

    Raises:
        ValueError: A setting has the name of a flag that every service has.
    """
    for taken in model.model_fields.keys() & set(TAKEN):
        raise ValueError(
            f"{model.__name__}.{taken}: every service has --{taken}; give the setting another name"
        )

    other_model, run_alone = alone or (None, None)

    def call(*, debug: bool, config: str | None, **flags: Any) -> None:
        leave_on_signals()
        end_with_parent()
        log_to_stderr(debug)
        connection = connection_from(flags, config=config)
        limits = {each: flags.pop(each) for each in ProcessorSettings.model_fields}
        load_settings(ProcessorSettings, flags=limits).apply()
        given = {each: flags.pop(each) for each in other_model.model_fields} if other_model else {}
        settings = load_settings(model, flags=flags, config=config)
        if (
            other_model is not None
            and run_alone is not None
            and any(value is not None for value in given.values())
        ):
            run_alone(settings, load_settings(other_model, flags=given))
        else:
            run = load()
            # Otherwise each full garbage collection visits what is imported, and the first delays a
            # frame by 20 ms. What is garbage by now would be kept for ever.
            gc.collect()
            gc.freeze()
            run(settings, connection)

    headings = dict(sections([*parameters_of(model), CONFIG]))
    connection = headings.popitem()
    if other_model is not None:
        headings["Without a router"] = parameters_of(other_model)
    headings |= {**dict([connection]), "Processors": parameters_of(ProcessorSettings)}
    return Command(name, call, headings, text, examples)


def run_service(
    run: Callable[[S, Connection], object],
    settings: type[S],
    *,
    examples: Sequence[str] = (),
) -> NoReturn:
    """Run a service of your own as a program with the options and behaviour of ``zv``'s services.

    Reads the settings from flags, environment, ``--config FILE.toml`` and defaults, in this order
    of precedence, and the connection likewise from its flags, ``ZV_CONNECT``, ``ZV_NAMESPACE``,
    ``ZV_ZENOH_CONFIG``, ``ZV_CREDENTIALS`` and ``ZV_TIMEOUT``, and the table ``connection`` of the
    file. The log goes to standard error. An error is one line there
    and an exit status: 0 told to stop, 2 wrong use or configuration, 3 a source that cannot be
    opened, 4 no router within ``--timeout``, 70 an unexpected error, with its traceback if
    ``--debug`` is given.

    ```python
    def run(settings: BlurSettings, connection: Connection) -> None:
        \"\"\"Publish each frame blurred.\"\"\"
        with Node("blur", connection=connection, parameters=settings) as node:
            ...

    if __name__ == "__main__":
        run_service(run, BlurSettings)
    ```

    Args:
        run: The loop, called with the settings and the connection; its docstring is the help.
        settings: Their class: ``ServiceSettings``, which has only the camera, or a subclass of it
            or of ``Settings``. Fields marked ``Live`` are parameters of the node that gets them.
        examples: Command lines that ``--help`` shows.

    Raises:
        SystemExit: Always, with the exit status.
        ValueError: A setting has the name of a flag that every service has.
    """
    name = program_name()
    text = DOCSTRING_SECTION.sub("", inspect.getdoc(run) or "")
    command = service_command(name, settings, lambda: run, text, examples)
    code = getattr(inspect.unwrap(run), "__code__", None)
    file = None if code is None else code.co_filename
    exit_with_status(lambda: run_command(command, name, sys.argv[1:]), name, file)


def program_name() -> str:
    """Return the name of the running program: ``blur`` of ``python blur.py``."""
    file = Path(sys.argv[0])
    return file.parent.name if file.stem == "__main__" else file.stem
