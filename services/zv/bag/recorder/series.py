"""Names of the files of a recorder, and the limit of the space that they take."""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path

from zv.bag.recorder.plan import Plan
from zv.bag.writer import PARTIAL

log = logging.getLogger("recorder")

UNFIT = re.compile(r"[^A-Za-z0-9_-]+")


class Series:
    """The files of one recorder: one of the name that was given, or several with times in it."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._last_ms = 0
        self._begin = f"{plan.output.stem}-".removeprefix("-")
        self._suffix = plan.output.suffix or ".mcap"

    def next_path(self, label: str = "") -> Path:
        """Return a path that no file has; the label becomes part of the name."""
        if not self._plan.is_series:
            return self._plan.output
        at_ms = max(time.time_ns() // 10**6, self._last_ms + 1)
        while True:
            at = time.strftime("%Y%m%dT%H%M%S", time.gmtime(at_ms // 1000))
            words = [f"{at}_{at_ms % 1000:03d}Z", UNFIT.sub("_", label).strip("_-")]
            name = self._begin + "-".join(filter(None, words)) + self._suffix
            path = self._plan.output.parent / name
            if not path.exists() and not path.with_name(name + PARTIAL).exists():
                self._last_ms = at_ms
                return path
            at_ms += 1

    def files(self) -> Iterator[Path]:
        """Yield the files of the series, the oldest first, those that were not closed too."""
        form = re.compile(
            rf"{re.escape(self._begin)}\d{{8}}T\d{{6}}_\d{{3}}Z.*{re.escape(self._suffix)}"
            rf"({re.escape(PARTIAL)})?"
        )
        found = [each for each in self._plan.output.parent.iterdir() if form.fullmatch(each.name)]
        yield from sorted(found, key=lambda each: each.name[len(self._begin) :])

    def make_room(self, writing: Collection[Path]) -> None:
        """Delete the oldest files until all are within the limit, but none being written."""
        limit = self._plan.total_bytes
        if limit is None or not self._plan.is_series:
            return
        sizes: dict[Path, int] = {}
        try:
            for path in self.files():
                with suppress(FileNotFoundError):  # it has got its name meanwhile
                    sizes[path] = path.stat().st_size
            for path in list(sizes):
                if sum(sizes.values()) <= limit:
                    break
                if path not in writing:
                    path.unlink(missing_ok=True)
                    del sizes[path]
                    log.info("deleted %s: the recordings are over %d MB", path, limit // 10**6)
        except OSError as error:
            log.warning("the oldest recording cannot be deleted: %s", error)
