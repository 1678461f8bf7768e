"""``zv up``: start a whole system from one file, and watch it."""

from __future__ import annotations

import inspect
import sys
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import typer

from common.connection import Connection
from common.errors import ConfigurationError
from common.settings import load_settings
from services.cli.options import (
    NOT_GIVEN,
    ConnectionSettings,
    command,
    common_parameters,
    log_to_stderr,
)
from services.router.settings import RouterSettings

DEFAULT_FILE = Path("configs/up.toml")

WORDS = """Start a whole system from one file: the router and every node in a process of its own.

Checks the options of all nodes first. Shows a table of them on a terminal, plain lines elsewhere.
A node that dies is started again; Ctrl-C ends everything.

Example: zv up configs/two-cameras.toml"""


def load(name: str) -> Any:
    """Return the command."""
    return command(name, run, parameters(), WORDS)


def parameters() -> list[inspect.Parameter]:
    """Return the command's flags."""
    own = {
        "file": Annotated[
            str | None,
            typer.Argument(
                metavar="FILE.toml",
                help=f"launch file; without it {DEFAULT_FILE}, or the one that is built in",
            ),
        ],
        "listen": Annotated[
            str | None,
            typer.Option(
                "--listen",
                metavar="ENDPOINT",
                help="where the router listens, instead of what the file says",
            ),
        ],
        "plain": Annotated[bool, typer.Option("--plain", help="plain lines, on a terminal too")],
    }
    return [
        *(
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=False if name == "plain" else NOT_GIVEN,
                annotation=annotation,
            )
            for name, annotation in own.items()
        ),
        *common_parameters(config=False),
    ]


def run(*, file: str | None, listen: str | None, plain: bool, debug: bool, **flags: Any) -> None:
    """Check the file and run the system."""
    from common.zenoh_config import listened_on, router_config
    from services.launch_file import read_launch_file
    from services.up import endpoint
    from services.up.browsers import prepared
    from services.up.service import run as run_system

    log_to_stderr(debug)
    if flags["connect"] and listen:
        raise ConfigurationError("--connect uses a router that runs, --listen starts one: give one")
    plan = read_launch_file(launch_file(file))
    given = load_settings(
        ConnectionSettings, flags=flags, inline=plan.connection, inline_place=plan.place
    )
    connection = Connection(given.connect, given.namespace, given.zenoh_config, given.timeout)
    listens = None
    if listen or "connect" not in given.model_fields_set:
        router = load_settings(
            RouterSettings,
            flags={"listen": listen},
            inline={} if plan.listen is None else {"listen": plan.listen},
            inline_place=f"{plan.place}: router",
        )
        stated = listened_on(router_config(router.listen, plan.router_config))
        if plan.router_config is None or stated == [router.listen]:
            listens = endpoint.free(router.listen)
        else:
            listens = endpoint.stated(plan.router_config, stated)
        connection = replace(connection, connect=endpoint.reach(listens))
    sys.exit(run_system(prepared(plan), connection, listens, plain=plain, debug=debug))


def launch_file(given: str | None) -> Path:
    """Return the launch file: the given one, the checkout's, or the built-in one."""
    if given is not None:
        return Path(given)
    if DEFAULT_FILE.is_file():
        return DEFAULT_FILE
    return Path(str(resources.files("services.up") / "configs" / "up.toml"))
