"""``zv router``, ``zv camera``, ``zv view`` and the like: one service in this process."""

from __future__ import annotations

import importlib
from typing import Any

from common.settings import load_settings
from services.catalogue import BY_COMMAND, SERVICES, model_of
from services.cli.options import (
    command,
    common_parameters,
    connection_from,
    leave_on_signals,
    log_to_stderr,
    parameters_of,
)
from services.up.lifeline import end_with_parent


def load(name: str) -> Any:
    """Return the command of this name, which starts a service."""
    service = BY_COMMAND[name]
    model = model_of(service)
    parameters = [*parameters_of(model, "Options"), *common_parameters()]
    words = f"{SERVICES[service].line}\n\nExample: {SERVICES[service].example}"

    def run(*, debug: bool, config: str | None, **flags: Any) -> None:
        leave_on_signals()
        end_with_parent()
        log_to_stderr(debug)
        connection = connection_from(flags)
        settings = load_settings(model, flags=flags, config=config)
        module = importlib.import_module(f"services.{service}.service")
        if service == "router":
            module.run(settings, connection.zenoh_config)
        else:
            module.run(settings, connection)

    return command(name, run, parameters, words)
