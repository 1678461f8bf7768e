"""Reads a file without dropping a frame, at the pace of the nodes that process it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import closing

from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.stream.counters import FrameCounters
from zv.camera import source_policy
from zv.camera.reader import CapturedFrame
from zv.camera.settings import CameraSettings
from zv.camera.source_policy import OpenSource
from zv.camera.sources.kinds import kind_of

FILES = ("video", "folder", "recording")
DEFAULT_RATE_HZ = 10.0


def frames(
    parameters: ParameterStore[CameraSettings],
    counters: FrameCounters,
    open_source: OpenSource,
    stopping: Callable[[], bool],
) -> Iterator[CapturedFrame]:
    """Yield every frame of a file, the next when it is asked for.

    Stamps are the file's own times, counted from when it was opened, whenever they are read.

    With the setting ``loop`` the file is read again, in a new epoch.

    Raises:
        ConfigurationError: The source is no file.
        SourceError: It cannot be opened, or has no picture.
    """
    kind = kind_of(parameters.newest.settings.source)
    if kind not in FILES:
        raise ConfigurationError(
            f"--lockstep: a {kind} source does not wait; allowed: a video file, a folder of "
            "images, a recording"
        )
    epoch = 0
    while not stopping():
        epoch = max(epoch + 1, time.time_ns())
        seq = 0
        settings = parameters.newest.settings
        with closing(open_source(settings, lambda: parameters.newest.settings)) as source:
            rate_hz = source_policy.imposed_rate(kind, settings)
            while not stopping() and (read := source.read()) is not None:
                due_s = read.due_s
                if rate_hz is not None or due_s is None:
                    due_s = seq / (rate_hz or source.rate_hz or DEFAULT_RATE_HZ)
                counters.arrive()
                yield CapturedFrame(
                    read.picture,
                    read.truth,
                    epoch,
                    seq,
                    epoch + round(due_s * 1e9),
                    parameters.activate(),
                    replay=epoch,
                )
                seq += 1
        if not seq and not stopping():
            raise SourceError(f"{settings.source}: ended without a single picture")
        if not parameters.newest.settings.loop:
            return
