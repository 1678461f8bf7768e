"""The viewer's options; flags, configuration files and live parameters derive from them."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field, model_validator

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.consumer_options import DepthMax, DepthMin, check_depth_range
from zenoh_vision.config.durations import SECONDS
from zenoh_vision.config.parameters import Live
from zenoh_vision.config.settings import NAME_FORM, Argument, LocalPath, Secret, Settings

TOKEN_PATTERN = r"^[A-Za-z0-9_.~-]{16,128}$"  # noqa: S105 - no token

CERTIFIED: Any = Field(pattern=r"^([A-Za-z0-9_.@ -]+(,[A-Za-z0-9_.@ -]+)*|\*)?$", max_length=1000)
CERTIFIED_FORM = Form("names separated by commas, or *")


def _url(text: str) -> str:
    """Check what the pattern does not: an address in brackets, and the port."""
    _ = urlsplit(text).port
    return text


class ViewerSettings(Settings):
    """Options of ``zv view``."""

    env_prefix: ClassVar[str] = "ZV_VIEWER_"

    name: Annotated[
        str,
        Field(
            pattern=r"^[a-z0-9_]*$",
            max_length=50,
            description="name of this viewer, where there are several: its node is then called "
            "viewer_NAME",
        ),
        NAME_FORM,
    ] = ""
    recording: Annotated[
        str | None,
        Argument("FILE.mcap"),
        Field(
            description="recording to show instead of a running system, with a time line; needs "
            "no router"
        ),
        LocalPath(),
    ] = None
    start: Annotated[
        float,
        Field(
            ge=0,
            le=10 * 365 * 86400,
            description="where to begin a recording, since its first sample",
        ),
        SECONDS,
    ] = 0.0
    host: Annotated[
        str,
        Field(
            min_length=1,
            max_length=255,
            description="address to serve on; all but loopback addresses require a token",
        ),
    ] = "127.0.0.1"
    port: Annotated[
        int, Field(ge=0, le=65535, description="TCP port to serve on; 0: any free port")
    ] = 8080
    address: Annotated[
        str,
        Field(
            pattern=r"^(https?://[A-Za-z0-9_.\[\]:-]+(/[A-Za-z0-9_.~-]+)*/?)?$",
            max_length=300,
            description="URL at which browsers reach the viewer, if it differs from host and port, "
            "as outside a container or behind a proxy, perhaps with a path; it is printed, and its "
            "host name is allowed",
        ),
        Form("http://HOST:PORT or https://HOST:PORT, perhaps with /PATH"),
        AfterValidator(_url),
    ] = ""
    token: Annotated[
        str | None,
        Field(
            pattern=TOKEN_PATTERN,
            description="token that browsers must present, for control; a token for viewing only "
            "is derived from it and printed too; not set: none if all addresses are loopback, "
            "else one that is generated on first use and kept",
        ),
        Form("16 to 128 letters, digits and _ . ~ -"),
        Secret(),
    ] = None
    allow_host: Annotated[
        str,
        Field(
            pattern=r"^[A-Za-z0-9_.,-]*$",
            max_length=1000,
            description="host names under which browsers with the token may reach the viewer, "
            "separated by commas, besides this machine's name and its addresses; a name that is "
            "not loopback makes the token required",
        ),
        Form("host names, separated by commas"),
    ] = ""
    tls_certificate: Annotated[
        str | None,
        Field(
            description="certificate of this viewer, PEM, with those between it and its authority; "
            "it is then served by https only"
        ),
        LocalPath(),
    ] = None
    tls_key: Annotated[
        str | None,
        Field(description="its private key, PEM; not set: in the file of the certificate"),
        LocalPath(),
    ] = None
    tls_clients: Annotated[
        str | None,
        Field(
            description="certificate of an authority, PEM: browsers with a certificate of it need "
            "no token; without --token, no others are let in"
        ),
        LocalPath(),
    ] = None
    tls_operators: Annotated[
        str,
        CERTIFIED,
        Field(description="names in those certificates that permit control; *: all"),
        CERTIFIED_FORM,
    ] = "operator"
    tls_guests: Annotated[
        str,
        CERTIFIED,
        Field(description="names in those certificates that permit viewing; *: all others"),
        CERTIFIED_FORM,
    ] = "guest"
    max_clients: Annotated[
        int,
        Field(ge=1, le=10_000, description="pages and streams served at once; more get 503"),
        Live(),
    ] = 100
    quality: Annotated[
        int,
        Field(ge=1, le=100, description="JPEG quality of pictures that the viewer encodes"),
        Live(),
    ] = 80
    depth_min: DepthMin = None
    depth_max: DepthMax = None
    events_dir: Annotated[
        str | None,
        Field(
            description="folder in which the events of trackers are kept, each with a small "
            "picture; not set: a folder of the user's state under zv up, else none are kept"
        ),
        LocalPath(is_made=True),
    ] = None
    keep_events: Annotated[
        float,
        Field(ge=0, le=31 * 86_400, description="how long they are kept; 0: none are kept"),
        SECONDS,
    ] = 86_400.0
    events_mb: Annotated[
        float,
        Field(ge=1, le=1e6, description="the oldest are deleted when all have more MB than this"),
    ] = 200.0
    recordings_dir: Annotated[
        str | None,
        Field(
            description="folder of recordings; events that are kept name those that hold them. Not "
            "set: under zv up that of its recorder, else none are looked for"
        ),
        LocalPath(is_made=True),
    ] = None
    max_age: Annotated[
        float,
        Field(ge=0.001, le=60, description="frames older than this are not shown"),
        Live("s"),
        SECONDS,
    ] = 1.0
    wait: Annotated[
        float,
        Field(ge=0.1, le=60, description="how long a snapshot waits for its picture"),
        Live("s"),
        SECONDS,
    ] = 2.0
    max_pixels: Annotated[
        int,
        Field(
            ge=1,
            le=7680 * 4320,
            description="width times height; larger frames are not shown. The memory to render "
            "two at once is up to 33 bytes a pixel",
        ),
    ] = 4096 * 2304

    _depth_in_order = model_validator(mode="after")(check_depth_range)

    @model_validator(mode="after")
    def _certificate_given(self) -> Self:
        for name in ("tls_key", "tls_clients"):
            if getattr(self, name) is not None and self.tls_certificate is None:
                raise ValueError(f"{name} needs tls_certificate")
        return self

    @property
    def node_name(self) -> str:
        """The name of the node: ``viewer``, or ``viewer_NAME``."""
        return f"viewer_{self.name}" if self.name else "viewer"

    @property
    def keeps_events(self) -> bool:
        """Whether events are kept: not those of a recording."""
        return bool(self.events_dir) and self.recording is None

    @property
    def names(self) -> list[str]:
        """Names besides ``host`` under which browsers reach the viewer, in lower case."""
        given = (*self.allow_host.split(","), urlsplit(self.address).hostname)
        return [name.lower() for name in given if name]

    @property
    def base_path(self) -> str:
        """The path of ``address``, such as ``/cameras``; empty without one."""
        return urlsplit(self.address).path.rstrip("/")
