"""``python -m benchmarks.quality [SUBJECT [OPTIONS]]``: measures quality against ground truth."""

from __future__ import annotations

import importlib
import sys

SUBJECTS = {
    "edges": "benchmarks.quality.edges.command",
    "tracker": "benchmarks.quality.tracker.command",
}
"""Module of each subject; its ``main`` takes the words after the subject."""


def main() -> None:
    """Run the measurement of one subject, or of all with their defaults."""
    words = sys.argv[1:]
    if words and words[0] not in SUBJECTS:
        sys.exit(f"usage: python -m benchmarks.quality [{'|'.join(SUBJECTS)}] [OPTIONS]")
    for subject in words[:1] or SUBJECTS:
        importlib.import_module(SUBJECTS[subject]).main(words[1:])


if __name__ == "__main__":
    main()
