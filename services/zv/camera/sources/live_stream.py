"""Reads a live stream with libav: true times of capture, and the newest picture first."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterator
from typing import Final

from av.container import InputContainer
from av.packet import Packet
from av.stream import Stream

from zv.camera.sources.base import TimedPicture
from zv.camera.sources.libav import Decoded, VideoDecoder, packet_time_s, video_stream
from zv.camera.sources.packet_losses import PacketLosses
from zv.camera.sources.packet_queue import Arrival, PacketQueue
from zv.camera.sources.stream_clock import StreamClock, stamp_ns

WITHOUT_TIMES: Final = frozenset({"h264", "hevc", "m4v", "mjpeg", "mpjpeg", "yuv4mpegpipe"})
"""Formats whose times libav counts up at a rate that the stream may not have."""

RTP: Final = frozenset({"rtsp", "rtp", "sdp"})
"""Formats whose packets libav counts, but which come as if none were missing."""

SUSPECT: Final = 2
"""Pictures that a loss may have damaged: that which ends with it, and that which begins."""

CLOSE_S: Final = 2.0


class LiveStream:
    """The pictures of an open container that has no end.

    A thread receives the packets. Those that have waited for longer than ``max_lag_s`` are skipped
    up to the newest key picture, undecoded. After a loss nothing is delivered up to the next key
    picture: libav would conceal the damage, and say nothing of it.

    Args:
        container: Owned from now on; on an error it is left open.
        timeout_s: Longest time to wait for a picture.
        max_lag_s: Returns the longest time from the capture to the decoder; 0 for no limit.
        number: Which of its videos, from 0.

    Attributes:
        clock: Maps the stream's times to this machine's clock.
        packets_lost: Number of packets that were lost since the last picture.
        has_times: Whether the stream has times of its own.
        summary: Size and codec, for people.

    Raises:
        NoVideo: It has no video.
    """

    def __init__(
        self,
        container: InputContainer,
        timeout_s: float,
        max_lag_s: Callable[[], float],
        number: int = 0,
    ) -> None:
        stream = video_stream(container, number)
        self._index = stream.index
        self._decoder = VideoDecoder(stream, low_delay=True)
        self.summary = self._decoder.summary
        self._timeout_s = timeout_s
        self._max_lag_s = max_lag_s
        self.clock = StreamClock()
        self.has_times = container.format.name not in WITHOUT_TIMES
        self._decoded: Iterator[Decoded] = iter(())
        self._arrived_s = 0.0  # of the packet that was decoded last
        self._skipped = 0
        self._is_late = False
        self._last_ns = 0
        self._is_damaged = False
        self._withheld = 0
        self._packets_lost = self._packets_told = 0
        self._marks_damage = stream.codec_context.name != "mjpeg"  # libav drops damaged JPEGs
        self._losses = PacketLosses() if container.format.name in RTP else None

        def close() -> None:
            container.close()
            if self._losses is not None:
                self._losses.stop()

        self._queue = PacketQueue(self._of_video(container), close, self._arrive)

    @property
    def packets_lost(self) -> int:
        """See the class."""
        return self._packets_lost - self._packets_told

    def read(self) -> TimedPicture | None:
        """Return the next picture, with the time of its capture; None at the end of the stream.

        Raises:
            FFmpegError: Receiving failed.
            TimeoutError: No picture came within the time limit.
        """
        deadline_s = time.monotonic() + self._timeout_s
        while (found := next(self._decoded, None)) is None:
            arrival = self._queue.take(max(0.0, deadline_s - time.monotonic()))
            if arrival is None:
                return None
            if not self._skips(arrival) and not self._withholds(arrival.packet):
                self._decoded = self._decoder.decode(arrival.packet)
                self._arrived_s = arrival.arrived_s
        self._skipped += self._queue.taken_overflow()
        skipped, self._skipped = self._skipped, 0
        age_s = time.monotonic() - self._captured_s(found.time_s, self._arrived_s)
        self._last_ns = stamp_ns(age_s, time.time_ns(), self._last_ns)
        lost, self._withheld = self._withheld + self._decoder.taken_damaged(), 0
        packets_lost = self.packets_lost
        self._packets_told += packets_lost
        return TimedPicture(
            found.picture,
            stamp_ns=self._last_ns,
            skipped=skipped,
            lost=lost,
            packets_lost=packets_lost,
        )

    def close(self) -> None:
        """Close the stream; safe to call twice."""
        self._decoded = iter(())
        self._queue.close(self._timeout_s + CLOSE_S)

    def _of_video(self, container: InputContainer) -> Iterator[Packet[Stream]]:
        """Yield the packets of the video; those that a loss may have damaged are marked."""
        suspect = 0
        if self._losses is not None:
            self._losses.start()
        for packet in container.demux():
            if self._losses is not None and (lost := self._losses.taken()):
                self._packets_lost += lost
                suspect = SUSPECT if self._marks_damage else 0
            if packet.stream.index == self._index and packet.size:
                if suspect:
                    packet.is_corrupt = True
                    suspect -= 1
                yield packet

    def _arrive(self, packet: Packet[Stream], arrived_s: float) -> None:
        time_s = packet_time_s(packet)
        if time_s is not None and self.has_times:
            self.clock.arrive(time_s, arrived_s, _delay_s(packet))

    def _captured_s(self, time_s: float | None, arrived_s: float) -> float:
        """Return the monotonic time of a capture; without a time of its own, of the arrival."""
        if time_s is None or not self.has_times:
            return arrived_s
        captured_s = self.clock.captured_s(time_s)
        return arrived_s if captured_s is None else captured_s

    def _skips(self, arrival: Arrival[Packet[Stream]]) -> bool:
        """Skip to the newest key picture if a packet is too old; tell whether it was skipped."""
        max_lag_s = self._max_lag_s()
        captured_s = self._captured_s(packet_time_s(arrival.packet), arrival.arrived_s)
        if not max_lag_s or time.monotonic() - captured_s <= max_lag_s:
            self._is_late = False
            return False
        if not self._is_late:
            self._queue.settle()
        self._is_late = True
        skipped = self._queue.skip_to_newest_key()
        if skipped is None:
            return False
        self._skipped += 1 + skipped
        self._decoder.forget()
        return True

    def _withholds(self, packet: Packet[Stream]) -> bool:
        """Tell whether a packet is damaged, or needs one that is."""
        if packet.is_corrupt:
            self._is_damaged = True
        elif self._is_damaged and packet.is_keyframe:
            self._is_damaged = False
            self._decoder.forget()
        self._withheld += self._is_damaged
        return self._is_damaged


def _delay_s(packet: Packet[Stream]) -> float | None:
    """Return arrival minus capture by the camera's wall clock, of an RTCP sender report."""
    if not packet.has_sidedata("prft"):
        return None
    captured_us: int = struct.unpack_from("=q", bytes(packet.get_sidedata("prft")))[0]
    return time.time() - captured_us / 1e6
