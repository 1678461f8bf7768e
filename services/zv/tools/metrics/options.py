"""The options of ``zv metrics``."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator, Field

from zenoh_vision.config.constraints import Form
from zenoh_vision.transport.endpoints import MAX_PORT
from zv.tools.shared.options import SECONDS, ToolOptions

ADDRESS = re.compile(r"(\[[^\[\]]+\]|[^:\[\]\s]+):([0-9]{1,5})")


def _address(text: str) -> str:
    found = ADDRESS.fullmatch(text)
    if found is None or int(found[2]) > MAX_PORT:
        raise ValueError("not HOST:PORT, such as 127.0.0.1:9464 or [::1]:9464")
    return text


class MetricsOptions(ToolOptions):
    """Options of ``zv metrics``."""

    listen: Annotated[
        str,
        AfterValidator(_address),
        Field(
            description="HOST:PORT to serve on; port 0: any free port. Anyone who reaches it can "
            "read all metrics: nothing is encrypted or restricted"
        ),
        Form("HOST:PORT, such as 127.0.0.1:9464 or [::1]:9464"),
    ] = "127.0.0.1:9464"
    gone: Annotated[
        float,
        Field(ge=0, le=86400, description="how long a node that is gone is listed as down"),
        SECONDS,
    ] = 300.0
