"""``zv router``, ``zv camera``, ``zv tracker``, ``zv edge``: one service in this process."""

from __future__ import annotations

import importlib
from typing import Any

from common.settings import Settings, load_settings
from services.cli.lifeline import end_with_parent
from services.cli.options import (
    command,
    common_parameters,
    connection_from,
    log_to_stderr,
    parameters_of,
)

MODELS = {
    "camera": "services.camera.settings:CameraSettings",
    "tracker": "services.tracker.settings:TrackerSettings",
    "edge": "services.edge.settings:EdgeSettings",
    "router": "services.router.settings:RouterSettings",
}
"""Each service and the model of its options; its loop is ``services.{name}.service.run``."""

EXAMPLES = {
    "camera": "zv camera --camera front --source walk.avi --rate 10 --loop",
    "tracker": "zv tracker --camera front --history 300",
    "edge": "zv edge --camera front --sigma 2 --high 150",
    "router": "zv router --listen tcp/0.0.0.0:7447",
}


def model_of(service: str) -> type[Settings]:
    """Return the model of a service's options, without loading the service."""
    module, name = MODELS[service].split(":")
    model: type[Settings] = getattr(importlib.import_module(module), name)
    return model


def commands() -> dict[str, Any]:
    """Return the commands of all services."""
    return {service: _command(service) for service in MODELS}


def _command(service: str) -> Any:
    model = model_of(service)
    parameters = [*parameters_of(model, "Options"), *common_parameters()]
    words = f"{model.__doc__}\n\nExample: {EXAMPLES[service]}"

    def run(*, debug: bool, config: str | None, **flags: Any) -> None:
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
