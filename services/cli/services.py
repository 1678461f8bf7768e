"""``zv router``, ``zv camera``, ``zv tracker``, ``zv edge``: one service in this process."""

from __future__ import annotations

import importlib
import signal
from types import FrameType
from typing import Any

from common.errors import ToldToStop
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
    """End in order although the service does not listen to signals yet."""
    raise ToldToStop("told to stop while starting")


def _command(service: str) -> Any:
    model = model_of(service)
    parameters = [*parameters_of(model, "Options"), *common_parameters()]
    words = f"{model.__doc__}\n\nExample: {SERVICES[service].example}"

    def run(*, debug: bool, config: str | None, **flags: Any) -> None:
        signal.signal(signal.SIGTERM, _leave)
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
