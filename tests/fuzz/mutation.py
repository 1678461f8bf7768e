"""Changes inputs within their structure, so that most of them get past the first parser.

The parsers of msgpack and JSON and the checks of fields are compiled, so that libFuzzer does not
see what an input reaches in them: it forgets the first inputs, and bytes by chance are no message.
"""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable, Sequence
from typing import Any

import msgpack

ODD: Sequence[Any] = (
    *(None, True, False, 0, 1, -1, 2**31, 2**53, 2**63 - 1, 2**64 - 1, -(2**63), 10**400),
    *(0.5, -0.0, 1e308, 5e-324, math.inf, -math.inf, math.nan),
    *("", "a", "front", "vision/**", "#/$defs/a", "\0\x1b[2J", "x" * 300, "é"),
    *([], {}, [0, 0, 1, 1], ["a"] * 150, {"a": 1}, {"$ref": "#"}),
)
KEPT = 0.2
BYTES = 0.2
"""Shares of a first input in place of the mutated one, and of mutations of bytes."""


def changed(value: Any, chance: random.Random) -> Any:
    """Return a value that differs from another somewhere in its depth."""
    if isinstance(value, dict) and value and chance.random() < 0.9:
        fields, name = dict(value), chance.choice(list(value))
        match chance.randrange(5):
            case 0:
                del fields[name]
            case 1:
                fields[chance.choice(("", "a", "header", name))] = chance.choice(ODD)
            case _:
                fields[name] = changed(fields[name], chance)
        return fields
    if isinstance(value, list | tuple) and value and chance.random() < 0.9:
        items, place = list(value), chance.randrange(len(value))
        match chance.randrange(5):
            case 0:
                del items[place]
            case 1:
                items[place:place] = items[place : place + 1] * chance.choice((1, 2, 100))
            case _:
                items[place] = changed(items[place], chance)
        return items
    if isinstance(value, int | float) and chance.random() < 0.5:
        return value + chance.choice((-1, 1, 0.5, 1000))
    return chance.choice(ODD)


def of_msgpack(data: bytes, chance: random.Random) -> bytes:
    """Return a msgpack value changed."""
    found = msgpack.unpackb(data, strict_map_key=False)
    return bytes(msgpack.packb(changed(found, chance)))


def of_json(data: bytes, chance: random.Random) -> bytes:
    """Return a JSON value changed."""
    return json.dumps(changed(json.loads(data), chance)).encode()


def _message(data: bytes, chance: random.Random) -> bytes:
    kind = data[:1] if chance.random() < 0.9 else chance.randbytes(1)
    return kind + of_msgpack(data[1:], chance)


def _frame(data: bytes, chance: random.Random) -> bytes:
    size = int.from_bytes(data[1:3], "little")
    header = of_msgpack(data[3 : 3 + size], chance)
    return data[:1] + len(header).to_bytes(2, "little") + header + data[3 + size :]


def _schema(data: bytes, chance: random.Random) -> bytes:
    text, _, value = data.partition(b"\0")
    if chance.random() < 0.7:
        return of_json(text, chance) + b"\0" + value
    return text + b"\0" + of_json(value, chance)


HOW: dict[str, Callable[[bytes, random.Random], bytes]] = {
    "message": _message,
    "msgpack": of_msgpack,
    "frame": _frame,
    "router_list": of_json,
    "page_command": of_json,
    "schema": _schema,
    "rights": of_json,
}
"""How inputs of a target are changed; those of the others by bytes only."""


class Mutator:
    """Makes the next input of a target from one that libFuzzer chose.

    Args:
        target: Its name.
        first: Its first inputs.
        mutate: Changes bytes, to so many at most.
    """

    def __init__(
        self, target: str, first: Sequence[bytes], mutate: Callable[[bytes, int], bytes]
    ) -> None:
        self._how = HOW[target]
        self._first = first
        self._mutate = mutate

    def __call__(self, data: bytes, max_size: int, seed: int) -> bytes:
        """Return an input of at most ``max_size`` bytes."""
        chance = random.Random(seed)
        if chance.random() < KEPT:
            data = chance.choice(self._first)
        if chance.random() < BYTES:
            return self._mutate(data, max_size)
        try:
            for _ in range(chance.choice((1, 1, 2, 4))):
                data = self._how(data, chance)
        except (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException):
            data = self._mutate(chance.choice(self._first), max_size)
        return data if len(data) <= max_size else self._mutate(data[:max_size], max_size)
