"""Runs one model on a thread of its own for several cameras: fair, newest first, in batches."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from zenoh_vision.errors import PayloadError
from zenoh_vision.host.abandoned_threads import abandon
from zv.tracker.detector.errors import ModelFailed
from zv.tracker.detector.model import Found, Model
from zv.tracker.detector.placement import Pixels

log = logging.getLogger(__name__)

WINDOW: Final = 20
"""Runs of which the mean time is reported."""


@dataclass(slots=True, eq=False)
class Request:
    """A picture that the model is to see."""

    camera: str  # whose
    size: tuple[int, int]  # width and height of the frame
    # Returns its pixels, at least as large as a width and height; called on the model's thread.
    reduced: Callable[[int, int], Pixels]
    least: float  # smallest score of a box
    overlap: float  # intersection over union from which on two boxes of a class show one object
    asked_s: float = field(default_factory=time.monotonic)  # when it was submitted
    found: Found | None = None  # the result
    error: PayloadError | ModelFailed | None = None  # why there is none: the picture or the run
    begun_s: float | None = None  # when the model began; None before
    run_s: float = 0.0  # the model's time for it: an equal share of the time for a batch

    @property
    def waited_s(self) -> float:
        """How long it waited for the model."""
        return 0.0 if self.begun_s is None else self.begun_s - self.asked_s


@dataclass(frozen=True, slots=True)
class Load:
    """What the model does."""

    waiting: int  # cameras whose picture waits for it
    run_s: float  # mean time of a picture, of the last runs; 0 before the first
    since_s: float  # for how long it has been running now; 0 if it is idle
    failed: str  # why the last run failed; empty if it did not


class ModelWorker:
    """One picture of each camera waits; the camera that has waited longest is served first.

    Args:
        model: The model.
        finished: Called on its thread with each request that is done.
    """

    def __init__(self, model: Model, finished: Callable[[Request], None]) -> None:
        self.model = model
        self._finished = finished
        self._waiting: dict[str, Request] = {}
        self._changed = threading.Condition()
        self._times: deque[tuple[float, int]] = deque(maxlen=WINDOW)
        self._begun_s: float | None = None
        self._failed = ""
        self._ended = False
        self._thread = threading.Thread(target=self._work, name="model", daemon=True)
        self._thread.start()

    def submit(self, request: Request) -> None:
        """Have the model see a picture, in the place of one of the same camera that waits."""
        with self._changed:
            self._waiting[request.camera] = request
            self._changed.notify()

    def close(self) -> None:
        """Stop after the run that is going on, which is not waited for: it may take long."""
        with self._changed:
            self._ended = True
            self._waiting.clear()
            self._changed.notify()
        abandon(self._thread)

    def load(self) -> Load:
        """Return what the model does at this moment."""
        with self._changed:
            pictures = sum(count for _, count in self._times)
            spent_s = sum(taken_s for taken_s, _ in self._times)
            since_s = 0.0 if self._begun_s is None else time.monotonic() - self._begun_s
            mean_s = spent_s / pictures if pictures else 0.0
            return Load(len(self._waiting), mean_s, since_s, self._failed)

    def _work(self) -> None:
        while True:
            with self._changed:
                self._begun_s = None
                while not self._waiting and not self._ended:
                    self._changed.wait()
                if self._ended:
                    return
                cameras = list(self._waiting)[: self.model.most]
                taken = [self._waiting.pop(camera) for camera in cameras]
                self._begun_s = begun_s = time.monotonic()
                for each in taken:
                    each.begun_s = begun_s
            self._see(taken, begun_s)
            for each in taken:
                self._finished(each)

    def _see(self, taken: list[Request], begun_s: float) -> None:
        prepared = []
        for each in taken:
            try:
                prepared.append((each, self.model.prepared(each.size, each.reduced)))
            except PayloadError as error:
                each.error = error
        if not prepared:
            return
        least = min(each.least for each, _ in prepared)
        overlap = min(each.overlap for each, _ in prepared)
        failed = ""
        try:
            found = self.model.detect([picture for _, picture in prepared], least, overlap)
            for (each, _), result in zip(prepared, found, strict=True):
                each.found = result
        except ModelFailed as error:
            failed = str(error)
        except Exception as error:  # the camera must go on
            log.exception("the model's outputs could not be used")
            failed = f"{type(error).__name__}: {error}"
        if failed:
            for each, _ in prepared:
                each.error = ModelFailed(failed)
        spent_s = time.monotonic() - begun_s
        for each, _ in prepared:
            each.run_s = spent_s / len(prepared)
        with self._changed:
            self._failed = failed
            self._times.append((spent_s, len(prepared)))
