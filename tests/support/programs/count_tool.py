"""``zv`` with one more tool, ``count up``: what the tests of the tools' frame run."""

from __future__ import annotations

import importlib
from typing import Annotated

from pydantic import Field

from zenoh_vision.config.settings import Argument, Letter
from zenoh_vision.errors import ExpectationNotMet
from zenoh_vision.transport.connection import Connection
from zv.tools import registry
from zv.tools.shared.discovery import nothing_matches
from zv.tools.shared.options import SECONDS, SHARE, ToolOptions
from zv.tools.shared.output import Output, table
from zv.tools.shared.session import ToolSession


class CountOptions(ToolOptions):
    what: Annotated[str, Argument("WHAT"), Field(description="what is counted")]
    more: Annotated[tuple[str, ...], Argument("MORE"), Field(description="more")] = ()
    for_: Annotated[float, Field(gt=0, description="how long"), SECONDS] = 60.0
    off: Annotated[float, Field(ge=0, lt=1, description="how much it may be off"), SHARE] = 0.1
    output: Annotated[str, Letter("o"), Field(description="where to")] = "-"
    loud: Annotated[bool, Field(description="in capitals")] = False
    header: Annotated[bool, Field(description="with a header")] = True


def run(options: CountOptions, connection: Connection, output: Output) -> None:
    if options.what == "nothing":
        raise ExpectationNotMet(nothing_matches("tree", ["trees", "stones"], kind="thing"))
    if options.what == "options":
        output.record(options.model_dump() | {"timeout": connection.timeout_s})
        return
    with ToolSession(connection) as session:
        output.note("counting")
        rows = [[options.what, 1, None]]
        output.show(table(["what", "number", "rest"], rows))
        number = 0
        while session.wait(0.01) and not output.as_json:
            output.line(f"{number} {options.what}")
            number += 1


registry.GROUPS["count"] = "Count things."
registry.TOOLS["count up"] = registry.Tool(
    f"{__name__}:CountOptions", f"{__name__}:run", "Count up.", "zv count up sheep --for 5s"
)


def main() -> None:
    from zv.cli import main

    importlib.reload(main).main()  # a fork server has loaded it without this tool


if __name__ == "__main__":
    main()
