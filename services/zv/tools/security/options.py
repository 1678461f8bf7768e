"""The options of the commands of ``zv security``."""

from __future__ import annotations

import ipaddress
import re
from typing import Annotated, Any, Final

from pydantic import AfterValidator, Field

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.settings import NAME_FORM, Argument, CameraName
from zenoh_vision.keys import NAME
from zenoh_vision.security.rights import ACTIONS, Action
from zenoh_vision.transport.endpoints import MAX_PORT, checked_endpoint
from zv.tools.shared.options import ToolOptions

FOLDER: Final = "security"
PORT: Final = 7447
DAYS: Final = 365
LABEL: Final = "[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?"
HOST: Final = re.compile(rf"({LABEL}\.)*(?!\d+$){LABEL}")
"""The name of a host: what ends in a number is an address, or a wrong one."""


def _host(text: str) -> str:
    try:
        is_address = not ipaddress.ip_address(text).is_unspecified and "%" not in text
    except ValueError:
        is_address = False
    if not is_address and not HOST.fullmatch(text):
        raise ValueError("no name of a host and no address")
    return text


def _router(text: str) -> str:
    if not text.startswith("tls/"):
        raise ValueError("it does not begin with tls/")
    return checked_endpoint(text)


def _key(text: str) -> str:
    import zenoh  # not for help

    try:
        return str(zenoh.KeyExpr.autocanonize(text.removeprefix("/")))
    except zenoh.ZError:
        raise ValueError("no key expression") from None


Host = Annotated[str, AfterValidator(_host), Form("a host's name or address, without port")]
Key = Annotated[str, AfterValidator(_key), Form("a key expression such as vision/front/image")]
NAMED: Final[Any] = {"pattern": f"^{NAME.pattern}$", "max_length": 64}
Name = Annotated[str, Field(**NAMED), NAME_FORM]
Cameras = Annotated[
    tuple[CameraName, ...],
    Field(description="camera: itself, its tracker and its edge detector; may be given again"),
]
Hosts = Annotated[
    tuple[Host, ...],
    Field(description="name or address at which nodes reach the router; may be given again"),
]
Operators = Annotated[
    tuple[Name, ...], Field(description="who sees everything and sets parameters")
]
Guests = Annotated[tuple[Name, ...], Field(description="who sees everything and sets nothing")]
Days = Annotated[int, Field(ge=1, le=3650, description="how long certificates are valid, days")]


class InitOptions(ToolOptions):
    """Options of ``zv security init``."""

    folder: Annotated[str, Argument("DIR"), Field(description="folder to make")] = FOLDER
    camera: Cameras = ("front",)
    host: Hosts = ()
    port: Annotated[
        int, Field(ge=1, le=MAX_PORT, description="TCP port on which the router listens")
    ] = PORT
    operator: Operators = ("operator",)
    guest: Guests = ("guest",)
    days: Days = DAYS


class InFolder(ToolOptions):
    """Base of the options of the commands that work in a folder."""

    dir: Annotated[str, Field(description="folder of zv security init")] = FOLDER


class AddOptions(InFolder):
    """Options of ``zv security add``."""

    camera: Cameras = ()
    operator: Operators = ()
    guest: Guests = ()
    player: Annotated[
        tuple[CameraName, ...],
        Field(
            description="camera as which zv bag play may send what was recorded; may be given again"
        ),
    ] = ()
    node: Annotated[
        str | None,
        Field(
            **NAMED,
            description="node of a service of your own, or one of several cameras: tracker; or who "
            "was revoked",
        ),
        NAME_FORM,
    ] = None
    publishes: Annotated[
        tuple[Key, ...], Field(description="key that the node publishes; may be given again")
    ] = ()
    subscribes: Annotated[
        tuple[Key, ...],
        Field(description="key expression that the node subscribes to; may be given again"),
    ] = ()
    description: Annotated[
        str | None,
        Field(description="file with what zv node info NODE --json printed, instead of both"),
    ] = None
    router: Annotated[
        str | None, Field(**NAMED, description="another router, with its --host"), NAME_FORM
    ] = None
    host: Hosts = ()
    connect_to: Annotated[
        Annotated[str, AfterValidator(_router)] | None,
        Field(description="endpoint of the router that this one connects to"),
        Form("tls/HOST:PORT"),
    ] = None


class RenewOptions(InFolder):
    """Options of ``zv security renew``."""

    name: Annotated[tuple[Name, ...], Argument("NAME"), Field(description="whose certificate")] = ()
    all: Annotated[bool, Field(description="the certificates of all")] = False
    host: Annotated[
        tuple[Host, ...],
        Field(description="further name or address of the router that is renewed"),
    ] = ()
    days: Annotated[
        int | None, Field(ge=1, le=3650, description="how long it is valid, days; default: as init")
    ] = None


class RevokeOptions(InFolder):
    """Options of ``zv security revoke``."""

    name: Annotated[
        tuple[Name, ...],
        Argument("NAME"),
        Field(min_length=1, description="whose certificates are no longer accepted"),
    ]


class WebOptions(InFolder):
    """Options of ``zv security web``."""

    name: Annotated[
        tuple[Name, ...],
        Argument("NAME"),
        Field(description="operator or guest who uses a browser; default: all"),
    ] = ()
    host: Annotated[
        tuple[Host, ...],
        Field(
            description="name or address of the viewer in browsers; default: those of the router; "
            "may be given again"
        ),
    ] = ()


class ShowOptions(InFolder):
    """Options of ``zv security show``."""

    name: Annotated[
        str | None,
        Argument("NAME"),
        Field(**NAMED, description="whose rights; default: list all"),
        NAME_FORM,
    ] = None


class CheckOptions(InFolder):
    """Options of ``zv security check``."""

    node: Annotated[Name, Argument("NODE"), Field(description="who")]
    key: Annotated[Key, Argument("KEY"), Field(description="on which key expression")]
    action: Annotated[Action, Argument("ACTION"), Field(description=f"one of {', '.join(ACTIONS)}")]
