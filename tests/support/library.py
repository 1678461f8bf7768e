"""What tests of the library share: gates, changed bytes, settings of every type."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, ClassVar, Literal, Self

from hypothesis import settings
from hypothesis import strategies as st
from pydantic import Field, model_validator

from zenoh_vision.config.parameters import Live
from zenoh_vision.config.settings import FromText, ServiceSettings
from zenoh_vision.errors import PayloadError
from zenoh_vision.messages import Header
from zenoh_vision.stream.epoch_gate import EpochGate


def seen(gate: EpochGate, found: Header, at_s: float = 0.0) -> Header:
    now_ns = int(at_s * 1e9)
    gate.admit(found, now_ns)
    gate.accept(found, now_ns, now_ns)
    return found


Changes = list[tuple[str, float, bytes]]

fuzz = settings(derandomize=True, deadline=None, database=None, max_examples=300)

changes = st.lists(
    st.tuples(st.sampled_from(["set", "cut", "insert"]), st.floats(0, 1), st.binary(max_size=4)),
    min_size=1,
    max_size=6,
)


def changed(whole: bytes, how: Changes) -> bytes:
    """Return bytes with some set, cut out or put in, at places given as shares of the length."""
    found = bytearray(whole)
    for kind, share, new in how:
        at = int(share * len(found))
        end = at if kind == "insert" else at + max(1, len(new))
        found[at:end] = b"" if kind == "cut" else new
    return bytes(found)


def tried(decode: Callable[[bytes], object], payload: bytes, reasons: set[str]) -> None:
    reason = None
    try:
        decode(payload)
    except PayloadError as error:
        reason = error.reason
    assert reason is None or reason in reasons


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
