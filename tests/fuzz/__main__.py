"""Fuzzes one decoder with atheris: TARGET [flags of libFuzzer, such as -max_total_time=3600]."""

from __future__ import annotations

import importlib
import sys

import atheris

from tests.fuzz.mutation import HOW, Mutator


def main() -> None:
    """Fuzz until the time is over, or there is a finding, whose input libFuzzer writes."""
    name, *flags = sys.argv[1:]
    with atheris.instrument_imports(include=["zenoh_vision", "zv", "tests.fuzz.targets"]):
        targets = importlib.import_module("tests.fuzz.targets")
        start = importlib.import_module("tests.fuzz.start")
    corpus = start.corpus_of(name)
    more = {}
    if name in HOW:
        first = [file.read_bytes() for file in sorted(corpus.iterdir())]
        # Fuzz() puts another function in the place of atheris.Mutate.
        mutator = Mutator(name, first, lambda data, size: bytes(atheris.Mutate(data, size)))
        more["custom_mutator"] = mutator
    atheris.Setup([sys.argv[0], *flags, str(corpus)], targets.TARGETS[name], **more)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
