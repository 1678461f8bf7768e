"""``Account``: what a recording says about what was taken and missed in a minute, checked."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

Number = Annotated[int, Field(ge=-(2**63), lt=2**64)]
Name = Annotated[str, Field(max_length=1024)]


class _Part(BaseModel):
    model_config = ConfigDict(strict=True, extra="ignore")


class EpochNumbers(_Part):
    """The numbers of one epoch of a key; the gaps are first and last number."""

    epoch: Number
    first: Number
    last: Number
    missing: Number
    gaps: Annotated[list[list[Number]], Field(max_length=100)] = []


class KeyCounts(_Part):
    """What became of the samples of a key."""

    taken: Number = 0
    bytes: Number = 0
    repeated: Number = 0
    unnumbered: Number = 0
    sender: Name = ""
    missed: dict[Name, Number] = {}
    epochs: Annotated[list[EpochNumbers], Field(max_length=1000)] = []


class Account(_Part):
    """What became of all samples between two times of arrival."""

    begin_ns: Number
    end_ns: Number
    keys: dict[Name, KeyCounts]
    senders: dict[Name, dict[Name, Number]] = {}
    notes: list[Name] = []
    left_out: Number = 0


def checked_account(text: str | bytes) -> dict[str, Any] | None:
    """Return the account in a JSON text; None if it is none."""
    try:
        return Account.model_validate_json(text).model_dump()
    except (ValidationError, RecursionError):
        return None
