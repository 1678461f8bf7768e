"""``zv`` with one more tool, ``count up``: what the tests of the tools' frame run."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from common.connection import Connection
from common.errors import ExpectationNotMet
from services.tools import catalogue
from services.tools.nearest import nothing_matches
from services.tools.options import SECONDS, SHARE, Argument, Letter, ToolOptions
from services.tools.output import Output
from services.tools.session import ToolSession


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
    if options.what == "surprise":
        raise RuntimeError("never seen before")
    if options.what == "options":
        output.record(options.model_dump() | {"timeout": connection.timeout_s})
        return
    with ToolSession(connection) as session:
        output.note("counting")
        rows = [[options.what, 1, None]]
        output.table(["what", "number", "rest"], rows)
        number = 0
        while session.wait(0.01) and not output.as_json:
            output.line(f"{number} {options.what}")
            number += 1


catalogue.GROUPS["count"] = "Count things."
catalogue.TOOLS["count up"] = catalogue.Tool(
    f"{__name__}:CountOptions", f"{__name__}:run", "Count up.", "zv count up sheep --for 5s"
)

if __name__ == "__main__":
    from services.cli.main import main

    main()
