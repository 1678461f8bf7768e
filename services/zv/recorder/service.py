"""The recorder's loop: reports how the recording goes."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence

from zenoh_vision import Connection, Node
from zenoh_vision.messages import Level
from zenoh_vision.stream.intake import InputState
from zv.bag.recorder.recorder import Recorder
from zv.recorder.settings import RecorderSettings

log = logging.getLogger("recorder")
POLL_S = 0.2


class _Keys:
    """What the recorder subscribes to, for its description; silence on it is no fault."""

    fault = ""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder

    @property
    def keys(self) -> tuple[str, ...]:
        return self._recorder.keys

    def states(self) -> Sequence[InputState]:
        return ()


def run(settings: RecorderSettings, connection: Connection) -> None:
    """Record until told to stop.

    While nothing can be written, its health is an error, and a warning while the disk is too slow.

    Raises:
        ConfigurationError: A key expression is none, or an option needs ``last``.
    """
    plan = settings.plan()
    with Node("recorder", camera=(), connection=connection, parameters=settings) as node:
        recorder = Recorder(node.link, connection.namespace, plan, node.name, is_patient=True)
        node.health.watch(_Keys(recorder))
        recorder.start()
        log.info(
            "%s %s",
            "keeps the last seconds for" if plan.last_s else "records into",
            plan.output.absolute(),
        )
        taken = missed = 0
        is_slow = False
        try:
            while not node.stopping:
                node.health.loop_alive()
                progress = recorder.progress()
                if progress.delay and not is_slow:
                    log.warning("%s", progress.delay)
                is_slow = bool(progress.delay)
                level = Level.ERROR if progress.failure else Level.WARN if is_slow else Level.OK
                node.health.report("disk", level, progress.failure or progress.delay)
                for _ in range(progress.taken - taken):
                    node.counters.arrive()
                    node.counters.finish()
                    node.health.done(None)
                node.counters.note("missed", max(0, progress.missed - missed))
                taken, missed = max(taken, progress.taken), max(missed, progress.missed)
                time.sleep(POLL_S)
        finally:
            recorder.stop()
