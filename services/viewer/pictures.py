"""One key's pictures, fanned out: newest only, each form made at most once a frame."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

import zenoh

from common.errors import PayloadError
from common.frame import Frame
from common.receiving import Arrival, FrameReceiver
from services.viewer.rendering import Form, render
from services.viewer.topics import camera_of, kind_of
from services.viewer.wire import Picture

if TYPE_CHECKING:
    from services.viewer.hub import Hub

SILENT_S = 1.0
SILENT_FRAMES = 3
INTERVALS = 8
OUTDATED_S = 0.2
"""A picture made so long ago is not given while a newer one is being made."""


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
        self._pending = False
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
        if self._pending:
            self._pending = False
            self.hub.ledger.drop("unwatched")

    def _declare(self, session: zenoh.Session) -> None:
        if self._ended or self._receiver is not None:
            return
        self._receiver = FrameReceiver(
            session,
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

    # Pictures

    @property
    def silent_s(self) -> float:
        """For how long nothing has come, beyond what is usual; 0 while it comes."""
        since_s = time.monotonic() - self._arrived_s
        usual_s = max([SILENT_S, *(SILENT_FRAMES * each for each in self._intervals)])
        return since_s if since_s > usual_s else 0.0

    @property
    def missed(self) -> int:
        """How many of the camera's frames never came here."""
        return 0 if self.newest is None else self.newest[0].missed

    def given(self) -> None:
        """Take note that a client got the newest."""
        if self._pending and self.newest is not None:
            self._pending = False
            self._done(self.newest[0].header.stamp_ns)

    def failed(self, number: int, error: PayloadError) -> None:
        """Take note that a picture could not be made into another form."""
        self.hub.health.complain(error)
        if self._pending and self.newest is not None and self.newest[0].number == number:
            self._pending = False
            self.hub.ledger.drop(error.reason)
        else:
            self.hub.ledger.note("not_rendered")

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
        taken = None if receiver is None else receiver.take_arrival(0)
        if taken is None:
            return
        if self._ended:
            self.hub.ledger.drop("unwatched")
            return
        if self._pending:
            self.hub.ledger.drop("overwritten")
        now_s = time.monotonic()
        if self.newest is not None:
            self._intervals.append(now_s - self._arrived_s)
        self._arrived_s, self.arrived_ns = now_s, time.time_ns()
        self.newest, self._pending = taken, True
        for rendition in list(self._forms.values()):
            rendition.offer()


class Rendition:
    """A stream in one form: made at most once a frame, only if a client is ready for it.

    Args:
        stream: Whose pictures.
        form: How they are wanted.
    """

    def __init__(self, stream: Pictures, form: Form) -> None:
        self.stream = stream
        self.form = form
        self.feeds: set[Feed] = set()
        self.picture: Picture | None = None
        self._busy = False
        self._tried = 0
        self._shown_s = 0.0

    def offer(self) -> None:
        """Make the newest frame into this form, unless it is made or nobody is ready."""
        newest = self.stream.newest
        if newest is None or self._busy or newest[0].number <= self._tried:
            return
        if not any(feed.wants for feed in self.feeds):
            return
        arrival, frame = newest
        self._tried = arrival.number
        header = arrival.header
        if not arrival.raw and self.form.leaves(frame.mime, header.width, header.height):
            self._show(arrival, arrival.payload, frame.mime, header.width, header.height)
            return
        if time.monotonic() - self._shown_s > OUTDATED_S:  # nobody was ready for long
            self.picture = None
        self._busy = True
        quality = self.stream.hub.options().quality
        work = self.stream.hub.loop.run_in_executor(
            self.stream.hub.pool, render, frame, self.form, quality
        )
        work.add_done_callback(lambda done: self._rendered(arrival, done))

    def _rendered(
        self, arrival: Arrival, done: asyncio.Future[tuple[bytes, str, int, int]]
    ) -> None:
        self._busy = False
        if done.cancelled():
            return
        error = done.exception()
        if error is None:
            self._show(arrival, *done.result())
        else:
            found = error if isinstance(error, PayloadError) else _unforeseen(error)
            self.stream.failed(arrival.number, found)
        self.offer()  # a newer one may have come meanwhile

    def _show(self, arrival: Arrival, payload: bytes, mime: str, width: int, height: int) -> None:
        self.picture = Picture(
            key=self.stream.key,
            header=arrival.header,
            payload=payload,
            mime=mime,
            width=width,
            height=height,
            number=arrival.number,
            missed=arrival.missed,
        )
        self._shown_s = time.monotonic()
        for feed in self.feeds:
            feed.notify()


class Feed:
    """What one client gets of a stream: the newest picture when it is ready, never a queue.

    Args:
        rendition: The stream in the form that the client wants.

    Attributes:
        on_ready: Called when there is a picture to take.
        skipped: How many pictures came between the last two that were taken.
    """

    def __init__(self, rendition: Rendition) -> None:
        self.rendition = rendition
        self.stream = rendition.stream
        self.on_ready: Callable[[], None] = lambda: None
        self.wants = False
        self.skipped = 0
        self._taken = 0
        self._missed_before = self.stream.missed
        self._event = asyncio.Event()

    def want(self) -> None:
        """Say that the client is ready for a picture."""
        if not self.wants:
            self.wants = True
            self.rendition.offer()
            if self.waiting:
                self.notify()

    def notify(self) -> None:
        """Take note that there is a newer picture."""
        if self.wants:
            self._event.set()
            self.on_ready()

    @property
    def waiting(self) -> bool:
        """Whether there is a picture that the client has not got.

        One who begins to watch a stream that has ended does not get its last picture.
        """
        picture = self.rendition.picture
        if picture is None or picture.number <= self._taken:
            return False
        return bool(self._taken) or not self.stream.silent_s

    def take(self) -> Picture | None:
        """Return the newest picture once; None if the client has it or is not ready."""
        picture = self.rendition.picture
        if picture is None or not (self.wants and self.waiting):
            return None
        self.wants = False
        self._event.clear()
        self.skipped = picture.number - self._taken - 1 if self._taken else 0
        self._taken = picture.number
        self.stream.given()
        return picture

    def lost(self, picture: Picture) -> int:
        """Return how many frames up to a picture never came since the client began."""
        return max(0, picture.missed - self._missed_before)

    async def next(self, timeout_s: float | None = None) -> Picture | None:
        """Return the newest picture as soon as there is one; None if there is none in time."""
        self.want()
        while (picture := self.take()) is None:
            self._event.clear()
            try:
                await asyncio.wait_for(self._event.wait(), timeout_s)
            except TimeoutError:
                return None
        return picture

    def close(self) -> None:
        """Want no more; the last client's leave ends the subscription."""
        self.wants = False
        self.stream.leave(self)


def _unforeseen(error: BaseException) -> PayloadError:
    return PayloadError("not_rendered", f"{type(error).__name__}: {error}")
