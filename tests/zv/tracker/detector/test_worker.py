"""One model for several cameras: who is served, and what becomes of failures."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest

from tests.support.waiting import wait_until
from zenoh_vision.errors import PayloadError
from zv.tracker.detector.errors import ModelFailed
from zv.tracker.detector.model import Found
from zv.tracker.detector.worker import ModelWorker, Request


class SlowModel:
    """A model whose runs wait until they are let go; it notes the cameras of each run."""

    def __init__(self, most: int = 1) -> None:
        self.most = most
        self.runs: list[list[str]] = []
        self.go = threading.Semaphore(0)
        self.error: Exception | None = None
        self.limits = (0.0, 0.0)

    def prepared(self, size: tuple[int, int], reduced: Any) -> Any:
        return reduced(*size)

    def detect(self, pictures: Sequence[str], least: float, overlap: float) -> list[Found]:
        self.limits = least, overlap
        self.runs.append(list(pictures))
        self.go.acquire()
        if self.error is not None:
            raise self.error
        return [Found() for _ in pictures]


@pytest.fixture
def model() -> Iterator[SlowModel]:
    made = SlowModel()
    yield made
    made.error = None
    made.go.release(100)


def request(camera: str, seen: Any = None) -> Request:
    return Request(camera, (1, 1), lambda *_: seen or camera, 0.1, 0.6)


def test_the_camera_that_waited_longest_is_served_with_its_newest_picture(model: SlowModel):
    done: list[Request] = []
    worker = ModelWorker(model, done.append)  # type: ignore[arg-type]
    worker.submit(request("a", "a0"))
    wait_until(lambda: model.runs)
    worker.submit(request("a", "a1"))
    worker.submit(request("b", "b0"))
    worker.submit(request("a", "a2"))
    assert worker.load().waiting == 2
    model.go.release(3)
    wait_until(lambda: len(done) == 3)
    assert model.runs == [["a0"], ["a2"], ["b0"]]
    worker.close()


def test_what_waits_is_seen_at_once_if_the_model_allows_it(model: SlowModel):
    model.most = 3
    done: list[Request] = []
    worker = ModelWorker(model, done.append)  # type: ignore[arg-type]
    worker.submit(request("a"))
    wait_until(lambda: model.runs)
    for camera in "bcde":
        worker.submit(request(camera))
    model.go.release(3)
    wait_until(lambda: len(done) == 5)
    assert model.runs == [["a"], ["b", "c", "d"], ["e"]]
    worker.close()


def test_a_batch_has_the_least_limits_of_its_cameras_and_shares_its_time(model: SlowModel):
    model.most = 2
    done: list[Request] = []
    worker = ModelWorker(model, done.append)  # type: ignore[arg-type]
    worker.submit(request("a"))
    wait_until(lambda: model.runs)
    worker.submit(Request("b", (1, 1), lambda *_: "b", 0.3, 0.4))
    worker.submit(Request("c", (1, 1), lambda *_: "c", 0.2, 0.7))
    model.go.release(1)
    wait_until(lambda: len(model.runs) == 2)
    time.sleep(0.3)
    model.go.release(1)
    wait_until(lambda: len(done) == 3)
    ended_s = time.monotonic()
    assert model.limits == (0.2, 0.4)
    b, c = done[1:]
    assert b.run_s == c.run_s
    assert b.begun_s is not None
    assert 0.3 <= b.run_s + c.run_s <= ended_s - b.begun_s  # both, not each, took the run
    worker.close()


def test_a_failed_run_is_reported_and_the_next_one_works(model: SlowModel):
    done: list[Request] = []
    worker = ModelWorker(model, done.append)  # type: ignore[arg-type]
    for error, words in (
        (ModelFailed("no memory"), "no memory"),
        (KeyError("boxes"), "KeyError: 'boxes'"),
    ):
        model.error = error
        worker.submit(request("a"))
        model.go.release()
        wait_until(lambda: done)
        failed = done.pop()
        assert isinstance(failed.error, ModelFailed)
        assert worker.load().failed == str(failed.error) == words
    model.error = None
    worker.submit(request("a"))
    model.go.release()
    wait_until(lambda: done)
    assert done[0].found is not None
    assert worker.load().failed == ""
    worker.close()


def test_a_damaged_picture_fails_alone(model: SlowModel):
    model.most = 2

    def damaged(*_: int) -> Any:
        raise PayloadError("corrupt", "half a JPEG")

    done: list[Request] = []
    worker = ModelWorker(model, done.append)  # type: ignore[arg-type]
    worker.submit(request("a"))
    wait_until(lambda: model.runs)
    worker.submit(Request("b", (1, 1), damaged, 0.1, 0.6))
    worker.submit(request("c"))
    model.go.release(2)
    wait_until(lambda: len(done) == 3)
    errors = {each.camera: each.error for each in done}
    assert errors["a"] is errors["c"] is None
    assert isinstance(errors["b"], PayloadError)
    worker.close()


def test_closing_does_not_wait_for_a_run(model: SlowModel):
    worker = ModelWorker(model, lambda _: None)  # type: ignore[arg-type]
    worker.submit(request("a"))
    wait_until(lambda: model.runs)
    worker.close()
    assert np.isfinite(worker.load().since_s)
