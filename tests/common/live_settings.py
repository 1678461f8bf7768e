"""Settings of every type, for the tests of live parameters."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from common.parameters import Live
from common.settings import FromText, ServiceSettings


class LampSettings(ServiceSettings):
    env_prefix: ClassVar[str] = "ZV_LAMP_"

    socket: Annotated[str, Field(description="where it is plugged in")] = "wall"
    power: Annotated[int, Field(ge=0, le=100, description="how bright"), Live("percent")] = 50
    blink: Annotated[
        float | None, Field(ge=0.5, le=20, description="how often"), Live("Hz", effect="it clicks")
    ] = None
    on: Annotated[bool, Field(description="whether it is lit"), Live()] = True
    colour: Annotated[Literal["white", "red"], Field(description="of the light"), Live()] = "white"
    bulbs: Annotated[Literal[1, 2, 4], FromText, Field(description="how many"), Live()] = 1
    seed: Annotated[int, Field(ge=0, lt=256, description="of the flicker"), Live()] = 0
    label: Annotated[str, Field(max_length=8, description="on it"), Live()] = ""
    low: Annotated[float, Field(ge=0, le=10, description="from"), Live("V")] = 1.0
    high: Annotated[float, Field(ge=0, le=10, description="to"), Live("V")] = 2.0

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.low > self.high:
            raise ValueError(f"low = {self.low:g} is above high; allowed: low at most high")
        return self


LIVE = ("power", "blink", "on", "colour", "bulbs", "seed", "label", "low", "high")
