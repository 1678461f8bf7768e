"""The options of ``zv param`` and its commands."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from zenoh_vision.config.settings import Argument, Letter
from zv.tools.shared.options import ToolOptions

Node = Annotated[
    str, Argument("NODE"), Field(description="name of the node, such as tracker_front")
]
Names = Annotated[tuple[str, ...], Argument("NAME"), Field(description="parameters; default: all")]


class ListOptions(ToolOptions):
    """Options of ``zv param list``."""

    node: Annotated[
        str | None,
        Argument("NODE"),
        Field(description="name of the node, or a pattern such as 'tracker_*'; default: all nodes"),
    ] = None


class NamedOptions(ToolOptions):
    """Options of ``zv param get`` and ``zv param describe``."""

    node: Node
    names: Names = ()


class SetOptions(ToolOptions):
    """Options of ``zv param set``."""

    node: Annotated[
        str,
        Argument("NODE"),
        Field(description="name of the node; * matches any characters, ? one character"),
    ]
    values: Annotated[
        tuple[str, ...],
        Argument("{NAME=VALUE|NAME VALUE}"),
        Field(description="values to set, all or none; NAME= or NAME=nil unsets"),
    ]


class DumpOptions(ToolOptions):
    """Options of ``zv param dump``."""

    node: Node
    output: Annotated[
        str, Letter("o"), Field(description="file to write; - is standard output")
    ] = "-"


class LoadOptions(ToolOptions):
    """Options of ``zv param load``."""

    node: Node
    file: Annotated[
        str,
        Argument("FILE.toml"),
        Field(description="TOML file of values, as written by zv param dump"),
    ]
