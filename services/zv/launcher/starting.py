"""Finds free ports for the router and the viewers of a launch file, then starts its system."""

from __future__ import annotations

import errno
import shlex
import socket
from dataclasses import replace
from importlib import resources
from pathlib import Path

from rich.console import Console

from zenoh_vision.config.settings import ALL_CAMERAS, cameras_of, load_settings
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.topics import CENTROID, COMPRESSED, EDGES
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.endpoints import MAX_PORT, local_endpoint, tcp_endpoint
from zenoh_vision.transport.zenoh_config import client_config, listen_endpoints, router_config
from zv.launcher.launch_file import Plan, Planned, PlannedNode, PlannedProgram
from zv.launcher.options import UpOptions
from zv.launcher.secure import SecureFiles
from zv.launcher.supervisor import System, run
from zv.recorder.settings import RecorderSettings
from zv.router.settings import RouterSettings
from zv.status.display import display_on
from zv.viewer.credentials import view_token
from zv.viewer.http.listener import free_port, url
from zv.viewer.http.token_store import state_folder, token_of
from zv.viewer.settings import ViewerSettings

DEFAULT_FILE = Path("configs/up.toml")
LINES_PERIOD_S = 5.0

WAY_OUT = "port = PORT in the settings of its [[node]], or ZV_VIEWER_PORT=PORT if they have none"
"""Options that set another port, for errors; both override the config file of the node."""

SHOWN = {"camera": COMPRESSED, "tracker": CENTROID, "edge": EDGES}
"""The main topic of each service; it may publish more."""


def launch_file(given: str | None) -> Path:
    """Return the path of the launch file: the given one, the checkout's, or the built-in one."""
    if given is not None:
        return Path(given)
    if DEFAULT_FILE.is_file():
        return DEFAULT_FILE
    built_in = Path(str(resources.files("zv.launcher") / "configs" / "up.toml"))
    if built_in.is_file():
        return built_in
    return Path(__file__).parents[3] / DEFAULT_FILE  # of the checkout, which has no copy


def start(
    plan: Plan,
    connection: Connection,
    options: UpOptions,
    *,
    own_router: bool,
    debug: bool,
) -> int:
    """Run the system of a launch file until it is over; return the exit status.

    Args:
        plan: The checked launch file.
        connection: How its nodes connect; the endpoint only if another router is used.
        options: Those of the command line; its router's endpoint overrides environment and
            launch file.
        own_router: Whether to start a router instead of using a running one.
        debug: Whether the nodes log more.

    Raises:
        ConfigurationError: An endpoint, a port or a Zenoh configuration file is wrong; nothing
            was started.
        RouterUnreachable: No router within the time allowed; everything was ended again.
    """
    secure = None
    if options.secure is not None:
        secure = SecureFiles.of(options.secure, plan.nodes, connection.namespace)
        plan = replace(plan, router_config=str(secure.router) if own_router else None)
        connection = replace(connection, credentials=str(secure.launcher))
    elif connection.credentials is not None:
        raise ConfigurationError(
            "--credentials are one node's; allowed: --secure DIR, where each node has its own"
        )
    listens = router_endpoint(plan, options.listen) if own_router else None
    if options.grace is not None:
        plan = replace(plan, grace_s=options.grace)
    if listens is not None:
        connection = replace(connection, connect=local_endpoint(listens))
    plan = with_ports(plan)
    client_config(connection)
    if listens is not None:
        router_config(listens, plan.router_config)
    greeting = how_to_subscribe(plan, connection, own_router=own_router)
    display = display_on(
        Console(highlight=False), plain=options.plain, lines_period_s=LINES_PERIOD_S
    )
    return run(System(plan, connection, listens, greeting, display, secure=secure, debug=debug))


def router_endpoint(plan: Plan, listen: str | None) -> str:
    """Return the endpoint, with a free port, on which a plan's router is to listen.

    Raises:
        ConfigurationError: The endpoint cannot be used, or a file is wrong.
    """
    router = load_settings(
        RouterSettings,
        flags={"listen": listen},
        inline={} if plan.listen is None else {"listen": plan.listen},
        inline_place=f"{plan.place}: router",
    )
    stated = listen_endpoints(router_config(router.listen, plan.router_config))
    if plan.router_config is None or stated == [router.listen]:
        return free(router.listen)
    if not stated or free(stated[0]) != stated[0]:
        raise ConfigurationError(
            f"{plan.router_config}: listen/endpoints = {stated} is not allowed here, since the "
            "nodes could not find the router; allowed: tcp/ADDRESS:PORT, or no listen/endpoints, "
            "which are then taken from listen of the launch file or --listen"
        )
    return stated[0]


def free(listen: str) -> str:
    """Return an endpoint that can be listened on, with port 0 replaced by a free port.

    Nodes and router start together. If another router had the port, the nodes would connect to it
    before ours could fail. So the port is tested first. Only the router checks endpoints other than
    TCP.

    Raises:
        ConfigurationError: The endpoint cannot be used; the text has the reason and a remedy.
    """
    found = tcp_endpoint(listen)
    if found is None:
        return listen
    try:
        if found.port > MAX_PORT:  # getaddrinfo would take it modulo 65536
            raise OverflowError(f"there is no port {found.port}")
        family, _, _, _, address = socket.getaddrinfo(
            found.address, found.port, type=socket.SOCK_STREAM
        )[0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            # Like the router, ignore closed connections of an earlier listener.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            return str(replace(found, port=probe.getsockname()[1]))
    except (OSError, OverflowError) as error:
        if getattr(error, "errno", None) == errno.EADDRINUSE:
            raise ConfigurationError(
                f"listen = {listen!r}: the port is in use, perhaps by a running router. "
                f"Use that one with --connect {local_endpoint(listen)}, "
                "or another port with --listen tcp/127.0.0.1:OTHER_PORT"
            ) from None
        said = getattr(error, "strerror", None) or error
        raise ConfigurationError(
            f"listen = {listen!r} is not possible: {said}; allowed: tcp/ADDRESS:PORT"
        ) from None


def with_ports(plan: Plan) -> Plan:
    """Return a plan in which every viewer has a free port, its token, and folders of events.

    The folder of recordings is that of the first recorder, if there is one.

    Raises:
        ConfigurationError: A port cannot be used; the text has the reason and a remedy.
    """
    settings = [each.settings for each in plan.nodes if isinstance(each, PlannedNode)]
    recorders = [each for each in settings if isinstance(each, RecorderSettings)]
    recordings = str(recorders[0].plan().output.parent.absolute()) if recorders else None
    return replace(plan, nodes=tuple(_with_port(plan, node, recordings) for node in plan.nodes))


def _with_port(plan: Plan, node: Planned, recordings: str | None) -> Planned:
    if isinstance(node, PlannedProgram) or not isinstance(node.settings, ViewerSettings):
        return node
    settings = node.settings
    try:
        port = free_port(settings.host, settings.port, WAY_OUT)
    except ConfigurationError as error:
        raise ConfigurationError(f"{plan.place}: {node.name}: {error}") from None
    events_dir = settings.events_dir
    if events_dir is None and settings.recording is None:
        events_dir = str(state_folder() / "events")
    known = {"port": port, "token": token_of(settings), "events_dir": events_dir}
    if settings.recordings_dir is None:
        known["recordings_dir"] = recordings
    return replace(node, settings=settings.model_copy(update=known))


def addresses(plan: Plan, *, view_only: bool = False) -> list[str]:
    """Return the addresses of the viewers, to open in a browser.

    With ``view_only`` those that do not permit control, of the viewers that have a token.
    """
    found = [
        node.settings
        for node in plan.nodes
        if isinstance(node, PlannedNode) and isinstance(node.settings, ViewerSettings)
    ]
    return [
        url(each.host, each.port, token, each.address, encrypted=each.tls_certificate is not None)
        for each in found
        for token in [view_token(each.token) if view_only and each.token else each.token]
        if token or not view_only
    ]


def how_to_subscribe(plan: Plan, connection: Connection, *, own_router: bool) -> list[str]:
    """Return lines that name the router, the keys, a program to run, and last the viewer."""
    whose = "started" if own_router else "already running"
    keys, lines = [], []
    for node in plan.nodes:
        if isinstance(node, PlannedNode) and node.service in SHOWN:
            topic = SHOWN[node.service]
            names: str = getattr(node.settings, "camera")  # noqa: B009 - of these services
            for camera in cameras_of(names) or (ALL_CAMERAS,):
                keys.append(topic.key(connection.namespace, camera))
                lines.append(f"  {keys[-1]:<36} {topic.encoding}")
    head = "; published keys, for any Zenoh program:" if keys else ""
    lines.insert(0, f"router: {connection.connect} ({whose}){head}")
    if keys:
        # Prefer a key without wildcards, which a shell would expand, and one of messages, which
        # are easier to read than pictures.
        told = max(keys, key=lambda key: ("*" not in key, key.endswith(CENTROID.name)))
        words = ["zv", "topic", "echo", told]
        if connection.credentials is None:
            words += ["--connect", connection.connect]
        else:
            guest = Path(connection.credentials).with_name("guest.json5")
            words += ["--credentials", str(guest if guest.is_file() else connection.credentials)]
        example = shlex.join(words)
        lines.append(f"for example: {example}")
    lines += (f"viewer, view only: {address}" for address in addresses(plan, view_only=True))
    return [*lines, *(f"viewer: {address}" for address in addresses(plan))]
