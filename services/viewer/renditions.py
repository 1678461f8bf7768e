"""A stream in one form, and what each client takes from it: the newest, never a queue."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from common.errors import PayloadError
from common.receiving import Arrival
from services.viewer.rendering import Form, render
from services.viewer.wire import Picture

if TYPE_CHECKING:
    from services.viewer.pictures import Pictures

OUTDATED_S = 0.2
"""A picture made so long ago is not given while a newer one is being made."""


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

    @property
    def held(self) -> set[int]:
        """The numbers of the frames that clients may yet get in this form."""
        found = {self._tried} if self._busy else set()
        return found if self.picture is None else found | {self.picture.number}

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
            found = error if isinstance(error, PayloadError) else unforeseen(error)
            self.stream.failed(arrival.number, found)
        self.offer()  # a newer one may have come meanwhile
        self.stream.settle()

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
        self.stream.given(picture.number)
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


def unforeseen(error: BaseException) -> PayloadError:
    """Return what a picture is dropped under that failed as none should."""
    return PayloadError("not_rendered", f"{type(error).__name__}: {error}")
