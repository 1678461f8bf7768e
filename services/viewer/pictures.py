"""One key's pictures while somebody watches: one subscription, fanned out in each form."""

from __future__ import annotations

import asyncio
import statistics
import time
from collections import deque
from typing import TYPE_CHECKING

from common.errors import PayloadError
from common.frame import Frame
from common.link import Link
from common.receiving import Arrival, FrameReceiver
from services.viewer.rendering import Form
from services.viewer.renditions import Feed, Rendition, unforeseen
from services.viewer.topics import camera_of, kind_of

if TYPE_CHECKING:
    from services.viewer.hub import Hub

SILENT_S = 1.0
SILENT_FRAMES = 3
INTERVALS = 8


class Pictures:
    """A key's pictures while somebody watches; on the browsers' loop.

    Args:
        key: Full key expression.
        hub: Whose stream it is.
    """

    def __init__(self, key: str, hub: Hub) -> None:
        self.key = key
        self.hub = hub
        self.newest: tuple[Arrival, Frame] | None = None
        self._forms: dict[Form, Rendition] = {}
        self._receiver: FrameReceiver | None = None
        self._ended = False
        self._woken = False
        self._proving = False
        self._pending: dict[int, int] = {}  # frames that no client got yet: number, stamp_ns
        self._arrived_s = time.monotonic()
        self.arrived_ns = time.time_ns()
        self._intervals: deque[float] = deque(maxlen=INTERVALS)

    # Life

    def declare(self) -> None:
        """Subscribe, if there is a session."""
        self.hub.network.do(self._declare)

    def end(self) -> None:
        """Unsubscribe, and forget the newest."""
        self._ended = True
        self.hub.network.do(lambda _: self._undeclare())
        self._drop(list(self._pending), "unwatched")

    def _declare(self, link: Link) -> None:
        if self._ended or self._receiver is not None:
            return
        self._receiver = FrameReceiver(
            link,
            self.key,
            camera=camera_of(self.key),
            raw=kind_of(self.key).raw,
            max_age_s=lambda: self.hub.options().max_age,
            ledger=self.hub.ledger,
            complain=self.hub.health.complain,
            arrived=self._wake,
        )
        self.hub.health.receivers.append(self._receiver)

    def _undeclare(self) -> None:
        receiver, self._receiver = self._receiver, None
        if receiver is not None:
            self.hub.health.receivers.remove(receiver)
            receiver.close(unread="unwatched")

    # Clients

    def feed(self, form: Form) -> Feed:
        """Return what one more client gets its pictures from."""
        rendition = self._forms.get(form)
        if rendition is None:
            rendition = self._forms[form] = Rendition(self, form)
        feed = Feed(rendition)
        rendition.feeds.add(feed)
        return feed

    def leave(self, feed: Feed) -> None:
        """Take a client's leave; the last one's ends the stream."""
        rendition = feed.rendition
        rendition.feeds.discard(feed)
        if not rendition.feeds and self._forms.get(rendition.form) is rendition:
            del self._forms[rendition.form]
        if not self._forms and not self._ended:
            self.hub.forget(self)
        self.settle()

    # Pictures

    @property
    def silent_s(self) -> float:
        """For how long nothing has come, beyond what is usual; 0 while it comes."""
        since_s = time.monotonic() - self._arrived_s
        # The lower median: one gap behind which the camera came back is not what is usual.
        frame_s = statistics.median_low(self._intervals) if self._intervals else 0.0
        usual_s = max(SILENT_S, SILENT_FRAMES * frame_s)
        return since_s if since_s > usual_s else 0.0

    @property
    def missed(self) -> int:
        """How many of the camera's frames never came here."""
        return 0 if self.newest is None else self.newest[0].missed

    def given(self, number: int) -> None:
        """Take note that a client got a frame; only the first one's counts."""
        stamp_ns = self._pending.pop(number, None)
        if stamp_ns is not None:
            self._done(stamp_ns)

    def failed(self, number: int, error: PayloadError) -> None:
        """Take note that a picture could not be made into another form."""
        self.hub.health.complain(error)
        if number in self._pending:
            self._drop([number], error.reason)
        else:
            self.hub.ledger.note("not_rendered")

    def settle(self) -> None:
        """Drop the frames that no client can get any more, as there are newer ones."""
        held = {number for rendition in self._forms.values() for number in rendition.held}
        if self.newest is not None:
            held.add(self.newest[0].number)
        self._drop([number for number in self._pending if number not in held], "overwritten")

    def _drop(self, numbers: list[int], reason: str) -> None:
        for number in numbers:
            del self._pending[number]
            self.hub.ledger.drop(reason)

    def _done(self, stamp_ns: int) -> None:
        self.hub.ledger.finish()
        self.hub.health.pace.note(time.monotonic(), (time.time_ns() - stamp_ns) / 1e6)

    def _wake(self) -> None:
        """Have the loop take the newest, on Zenoh's thread: at most one call under way."""
        if not self._woken:
            self._woken = True
            try:
                self.hub.loop.call_soon_threadsafe(self._take)
            except RuntimeError:  # the loop has ended
                return

    def _take(self) -> None:
        self._woken = False
        receiver = self._receiver
        if receiver is None or self._proving or self._ended:
            return  # what waits in the slot is dropped with the subscription
        while (arrival := receiver.arrival(0)) is not None:
            if arrival.challenger:
                self._prove(receiver, arrival)
                return
            self._come(arrival, receiver.accept(arrival))

    def _prove(self, receiver: FrameReceiver, arrival: Arrival) -> None:
        """Decode the first of a run, which may take long: not where all browsers are served.

        What comes meanwhile waits in its slot, so that the order is kept and the newest is next.
        """
        self._proving = True
        work = self.hub.loop.run_in_executor(self.hub.pool, receiver.accept, arrival)
        work.add_done_callback(lambda done: self._proven(arrival, done))

    def _proven(self, arrival: Arrival, done: asyncio.Future[Frame | None]) -> None:
        self._proving = False
        if done.cancelled():
            self.hub.ledger.drop("unwatched")
            return
        error = done.exception()
        if error is None:
            self._come(arrival, done.result())
        else:
            found = unforeseen(error)
            self.hub.ledger.drop(found.reason)
            self.hub.health.complain(found)
        self._take()

    def _come(self, arrival: Arrival, frame: Frame | None) -> None:
        """Make a frame the newest and offer it; None is what was found to be none."""
        if frame is None:
            return
        if self._ended:
            self.hub.ledger.drop("unwatched")
            return
        now_s = time.monotonic()
        if self.newest is not None:
            if self.newest[0].header.epoch != arrival.header.epoch:
                self._intervals.clear()
            else:
                self._intervals.append(now_s - self._arrived_s)
        self._arrived_s, self.arrived_ns = now_s, time.time_ns()
        self.newest = arrival, frame
        self._pending[arrival.number] = arrival.header.stamp_ns
        for rendition in list(self._forms.values()):
            rendition.offer()
        self.settle()
