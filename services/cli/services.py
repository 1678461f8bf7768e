"""``zv router``, ``zv camera``, ``zv tracker``, ``zv edge``: one service in this process."""

from __future__ import annotations

import importlib
import os
import signal
from types import FrameType
from typing import Any

from common.settings import load_settings
from services.catalogue import SERVICES, model_of
from services.cli.options import (
    command,
    common_parameters,
    connection_from,
    log_to_stderr,
    parameters_of,
)
from services.up.lifeline import end_with_parent


def commands() -> dict[str, Any]:
    """Return the commands of all services."""
    return {service: _command(service) for service in SERVICES}


def _leave(_number: int, _at: FrameType | None) -> None:
    """End although the service does not listen to signals yet; nothing is open that must be closed.

    An exception would come out of whatever happens to run, some of which swallows or wraps it.
    """
    os._exit(0)


def _command(service: str) -> Any:
    model = model_of(service)
    parameters = [*parameters_of(model, "Options"), *common_parameters()]
    words = f"{model.__doc__}\n\nExample: {SERVICES[service].example}"

    def run(*, debug: bool, config: str | None, **flags: Any) -> None:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, _leave)
        end_with_parent()
        log_to_stderr(debug)
        connection = connection_from(flags)
        settings = load_settings(model, flags=flags, config=config)
        module = importlib.import_module(f"services.{service}.service")
        if service == "router":
            module.run(settings, connection.zenoh_config)
        else:
            module.run(settings, connection)

    return command(service, run, parameters, words)
