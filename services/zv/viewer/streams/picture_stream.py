"""The pictures of one key: one subscription, and the newest picture rendered for each client."""

from __future__ import annotations

import asyncio
import statistics
import time
from collections import deque
from collections.abc import Iterable
from contextlib import suppress

from zenoh_vision.errors import PayloadError
from zenoh_vision.image.depth import RangeFinder
from zenoh_vision.image.frame import Frame
from zenoh_vision.stream.frame_intake import Arrival, FrameIntake
from zenoh_vision.stream.intake import Consumer
from zv.viewer.streams.rendering import EncodedPicture, RenderOptions, original, render
from zv.viewer.streams.shared_stream import OnClosed, SharedStream, StreamContext
from zv.viewer.topics import kind_of

SILENT_S = 1.0
SILENT_FRAMES = 3
INTERVALS = 8
OUTDATED_S = 0.2
"""A picture rendered this long ago is not sent while a newer one is being rendered."""


class PictureStream(SharedStream[FrameIntake]):
    """Fans out the pictures of a key; each frame counts as processed once a client has got it."""

    def __init__(self, context: StreamContext, key: str, on_closed: OnClosed) -> None:
        super().__init__(context, key, on_closed)
        self.newest: tuple[Arrival, Frame] | None = None
        self.finder = RangeFinder()  # of the values of its 16-bit pictures
        self._arrived = asyncio.Event()
        self._renditions: dict[RenderOptions, Rendition] = {}
        self._verifying = False
        self._pending: dict[int, int] = {}  # frames that no client has got: number, stamp_ns
        self._arrived_s = time.monotonic()
        self._arrived_ns = time.time_ns()
        self._intervals: deque[float] = deque(maxlen=INTERVALS)

    # Subscription

    def close(self) -> None:
        """Unsubscribe, and drop the frames that no client has got."""
        super().close()
        self._drop(list(self._pending), "unwatched")

    def _new_intake(self, consumer: Consumer) -> FrameIntake:
        most = self._context.settings().max_pixels
        return FrameIntake(self.key, consumer, encoding=kind_of(self.key).type, max_pixels=most)

    def _close_intake(self, intake: FrameIntake) -> None:
        if not self._verifying:  # else its memory is being read, and ``_verified`` closes it
            super()._close_intake(intake)

    # Clients

    def feed(self, options: RenderOptions, ready: asyncio.Event | None = None) -> PictureFeed:
        """Return the feed of one more client; it sets ``ready`` when a picture can be taken."""
        rendition = self._renditions.get(options)
        if rendition is None:
            rendition = self._renditions[options] = Rendition(self, self._context, options)
        return PictureFeed(self, rendition, ready or asyncio.Event())

    async def wait(self, timeout_s: float) -> bool:
        """Wait for the first frame; return whether there is one in time."""
        with suppress(TimeoutError):
            await asyncio.wait_for(self._arrived.wait(), timeout_s)
        return self.newest is not None

    def newest_frame(self) -> Frame:
        """Return the newest frame without counting it as delivered."""
        assert self.newest is not None
        return self.newest[1]

    def remove_unused(self, rendition: Rendition) -> None:
        """Remove a rendition that no client uses; without renditions the stream ends."""
        if not rendition.feeds and self._renditions.get(rendition.options) is rendition:
            del self._renditions[rendition.options]
        if not self._renditions and not self.closed:
            self.close()
        self._drop_unreachable()

    @property
    def ended_ns(self) -> int | None:
        """When the last picture arrived, ns since 1970; None unless the stream has ended.

        A stream has ended when nothing arrived for 1 s and 3 frame times.
        """
        # The lower median, since a single long gap is not the frame time.
        frame_s = statistics.median_low(self._intervals) if self._intervals else 0.0
        silent_s = time.monotonic() - self._arrived_s
        return self._arrived_ns if silent_s > max(SILENT_S, SILENT_FRAMES * frame_s) else None

    # Accounting

    def delivered(self, number: int) -> None:
        """Count a frame as processed when the first client has got it."""
        stamp_ns = self._pending.pop(number, None)
        if stamp_ns is not None:
            self._context.processed(stamp_ns)

    def rendered(self, number: int, error: PayloadError | None) -> None:
        """Note that a frame was rendered, or could not be rendered."""
        if error is not None:
            self._context.health.log_drop(error)
            if number in self._pending:
                self._drop([number], error.reason)
            else:
                self._context.counters.note("not_rendered")
        self._drop_unreachable()

    def _drop_unreachable(self) -> None:
        """Drop the frames that no client can get any more, since newer ones exist.

        The viewer was too slow only if a client was ready for one.
        """
        is_wanted = any(rendition.ready_feeds for rendition in self._renditions.values())
        held = set().union(*(rendition.held for rendition in self._renditions.values()))
        if self.newest is not None:
            held.add(self.newest[0].number)
        reason = "overwritten" if is_wanted else "unready"
        self._drop(self._pending.keys() - held, reason)

    def _drop(self, numbers: Iterable[int], reason: str) -> None:
        for number in numbers:
            del self._pending[number]
            self._context.counters.drop(reason)

    # Arrivals

    def _receive(self, intake: FrameIntake) -> None:
        while not self._verifying and (arrival := intake.buffer.take(0)) is not None:
            settings = self._context.settings()
            max_age_s = settings.max_age
            self.finder.limits = settings.depth_min, settings.depth_max
            if arrival.unverified:
                self._verify(intake, arrival, max_age_s)
            else:
                self._show(arrival, intake.accept(arrival, max_age_s))

    def _verify(self, intake: FrameIntake, arrival: Arrival, max_age_s: float) -> None:
        """Decode the first frame of an epoch on another thread, as that may take long.

        Frames that arrive meanwhile wait in the buffer: the order is kept, and the newest is next.
        """
        self._verifying = True
        work = self._context.run(intake.accept, arrival, max_age_s)
        work.add_done_callback(lambda done: self._verified(arrival, done))

    def _verified(self, arrival: Arrival, done: asyncio.Future[Frame | None]) -> None:
        self._verifying = False
        if self.closed and self._intake is not None:
            self._close_intake(self._intake)
        if done.cancelled():
            self._context.counters.drop("unwatched")
            return
        error = done.exception()
        if error is None:
            self._show(arrival, done.result())
        else:
            self._context.drop(_render_error(error))
        self._on_arrival()

    def _show(self, arrival: Arrival, frame: Frame | None) -> None:
        """Make a frame the newest and offer it to all clients; None if it was dropped."""
        if frame is None:
            return
        if self.closed:
            self._context.counters.drop("unwatched")
            return
        now_s = time.monotonic()
        if self.newest is not None:
            if self.newest[0].header.run != arrival.header.run:
                self._intervals.clear()
            else:
                self._intervals.append(now_s - self._arrived_s)
        self._arrived_s, self._arrived_ns = now_s, time.time_ns()
        self.newest = arrival, frame
        self._arrived.set()
        self._pending[arrival.number] = arrival.header.age_start_ns
        for rendition in self._renditions.values():
            rendition.render_newest()
        self._drop_unreachable()


class Rendition:
    """Renders a stream's frames for all clients with the same options.

    Each frame is rendered at most once, and only while a client is ready for it.
    """

    def __init__(
        self, stream: PictureStream, context: StreamContext, options: RenderOptions
    ) -> None:
        self.options = options
        self.feeds: set[PictureFeed] = set()
        self.ready_feeds: set[PictureFeed] = set()
        self.picture: EncodedPicture | None = None  # the newest that was rendered
        self._stream = stream
        self._context = context
        self._tried = 0  # number of the frame rendered last or being rendered
        self._in_work = False
        self._rendering: Arrival | None = None
        self._rendered_s = 0.0

    @property
    def held(self) -> set[int]:
        """Numbers of the frames that clients may still get from this rendition."""
        found = {self._tried} if self._in_work else set()
        return found if self.picture is None else found | {self.picture.number}

    def render_newest(self) -> None:
        """Render the newest frame, unless it was rendered already or no client is ready."""
        if self._stream.newest is None or self._in_work or not self.ready_feeds:
            return
        arrival, frame = self._stream.newest
        if arrival.number <= self._tried:
            return
        self._tried = arrival.number
        unchanged = original(frame, self.options)
        if unchanged is not None:
            self._publish(arrival, unchanged)
            return
        if time.monotonic() - self._rendered_s > OUTDATED_S:  # it is old, since no client was ready
            self.picture = None
        self._in_work = True
        work = self._context.run(self._render, self._context.settings().quality)
        work.add_done_callback(self._finish)

    def _render(self, quality: int) -> EncodedPicture:
        """Render the newest frame; called on a thread, perhaps some time after it was requested."""
        assert self._stream.newest is not None
        self._rendering, frame = self._stream.newest
        self._tried = self._rendering.number
        return render(frame, self.options, quality, self._stream.finder)

    def _finish(self, done: asyncio.Future[EncodedPicture]) -> None:
        self._in_work = False
        if done.cancelled():
            return
        error = done.exception()
        arrival = self._rendering
        assert arrival is not None
        if error is None:
            self._publish(arrival, done.result())
        self.render_newest()  # a newer one may have arrived meanwhile
        self._stream.rendered(arrival.number, None if error is None else _render_error(error))

    def _publish(self, arrival: Arrival, picture: EncodedPicture) -> None:
        picture.number, picture.missed = arrival.number, arrival.missed
        self.picture = picture
        self._rendered_s = time.monotonic()
        for feed in self.ready_feeds:
            feed.ready.set()


class PictureFeed:
    """Gives one client the newest picture whenever it is ready, without a queue."""

    def __init__(self, stream: PictureStream, rendition: Rendition, ready: asyncio.Event) -> None:
        self.stream = stream
        self.options = rendition.options
        self.ready = ready
        self.skipped = 0  # number of pictures not taken between the last two that were taken
        self.lost = 0  # number of frames that never arrived since the start of the feed
        self._rendition = rendition
        self._taken = 0  # number of the picture that was taken last
        self._missed_before = 0 if stream.newest is None else stream.newest[0].missed
        rendition.feeds.add(self)

    def want(self) -> None:
        """Declare the client ready for a picture."""
        if self not in self._rendition.ready_feeds:
            self._rendition.ready_feeds.add(self)
            self._rendition.render_newest()
            if self.waiting:
                self.ready.set()

    @property
    def waiting(self) -> bool:
        """Whether there is a picture that the client has not got.

        A client that begins to watch a stream that has ended does not get its last picture.
        """
        picture = self._rendition.picture
        if picture is None or picture.number <= self._taken:
            return False
        return bool(self._taken) or self.stream.ended_ns is None

    def take(self) -> EncodedPicture | None:
        """Return the newest picture once; None if the client has it or is not ready."""
        picture = self._rendition.picture
        if picture is None or self not in self._rendition.ready_feeds or not self.waiting:
            return None
        self._rendition.ready_feeds.remove(self)
        self.skipped = picture.number - self._taken - 1 if self._taken else 0
        self.lost = max(0, picture.missed - self._missed_before)
        self._taken = picture.number
        self.stream.delivered(picture.number)
        return picture

    async def next(self, timeout_s: float | None = None) -> EncodedPicture | None:
        """Return the newest picture as soon as there is one; None if there is none in time."""
        self.want()
        while (picture := self.take()) is None:
            self.ready.clear()
            try:
                await asyncio.wait_for(self.ready.wait(), timeout_s)
            except TimeoutError:
                return None
        return picture

    def close(self) -> None:
        """End the feed; the subscription ends with the last feed."""
        self._rendition.ready_feeds.discard(self)
        self._rendition.feeds.discard(self)
        self.stream.remove_unused(self._rendition)


def _render_error(error: BaseException) -> PayloadError:
    """Return the error to count: the error itself, or ``not_rendered`` for an unexpected one."""
    if isinstance(error, PayloadError):
        return error
    return PayloadError("not_rendered", f"{type(error).__name__}: {error}")
