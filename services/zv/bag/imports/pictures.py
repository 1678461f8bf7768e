"""Videos and folders of images, as records."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import av
import numpy as np
from av.error import FFmpegError

from zenoh_vision.errors import PayloadError, SourceError
from zenoh_vision.image import codecs
from zenoh_vision.image.exif import as_stored
from zenoh_vision.image.files import decoded, images_in
from zenoh_vision.image.picture import JpegPicture, Picture, PixelPicture, picture_of
from zv.bag.imports.stream import CameraStream
from zv.bag.record import Record

Progress = Callable[[int, int], None]
DEFAULT_HZ = 10.0


def video_records(
    path: Path, stream: CameraStream, progress: Progress, note: Callable[[str], None]
) -> Iterator[Record]:
    """Yield the frames of a video, at its own times after that of its file.

    MJPEG is taken as it is, and any other video decoded. ``note`` is called with a line about what
    of a damaged video is left out.

    Raises:
        SourceError: It is no video, or none of its pictures can be read.
    """
    begin_ns = _written_ns(path)
    count = stated = 0
    failures: list[FFmpegError] = []
    try:
        with av.open(f"file:{path}", metadata_errors="replace") as container:
            if not container.streams.video:
                raise SourceError(f"{path}: has no video")
            video = container.streams.video[0]
            rate = float(video.average_rate or DEFAULT_HZ)
            total = int((container.duration or 0) * 1000)
            stated = video.frames
            for at_s, picture in _pictures(container, video, rate, failures.append):
                stamp_ns = begin_ns + round(at_s * 1e9)
                progress(stamp_ns - begin_ns, total)
                yield stream.frame(picture, stamp_ns)
                count += 1
    except (FFmpegError, PayloadError) as error:
        why = error.strerror if isinstance(error, FFmpegError) else error
        if not count:
            raise SourceError(f"{path}: not a video that can be read: {why}") from None
        note(f"{path}: damaged after {count} frames ({why}); the rest is left out")
        return
    if failures and not count:
        raise SourceError(f"{path}: not a video that can be read: {failures[0].strerror}")
    if failures or count < stated:  # what is damaged, libav may skip without a word
        frames = f"{stated} frames by its header" if stated else f"{len(failures)} damaged frames"
        note(f"{path}: damaged: it has {frames}, and {count} could be read")


def _pictures(
    container: av.container.InputContainer,
    video: av.VideoStream,
    rate: float,
    failed: Callable[[FFmpegError], None],
) -> Iterator[tuple[float, Picture]]:
    """Yield time in seconds and picture; ``failed`` is told of each that is damaged."""
    is_mjpeg = video.codec_context.name == "mjpeg"
    begin_s: float | None = None
    for number, packet in enumerate(container.demux(video)):
        if is_mjpeg and packet.size:
            at_s = number / rate
            if packet.pts is not None and video.time_base is not None:
                at_s = float(packet.pts * video.time_base)
            begin_s = at_s if begin_s is None else begin_s
            try:
                yield at_s - begin_s, JpegPicture(bytes(packet))
                continue
            except PayloadError:
                pass  # without Huffman tables, as AVI has them; libav knows these
        try:
            decoded_frames = packet.decode()
        except FFmpegError as error:
            failed(error)
            continue
        for frame in decoded_frames:
            at_s = frame.time if frame.time is not None else number / rate
            begin_s = at_s if begin_s is None else begin_s
            yield (
                at_s - begin_s,
                PixelPicture(np.asarray(frame.to_ndarray(format="bgr24"), np.uint8)),
            )


def folder_records(
    path: Path, stream: CameraStream, rate_hz: float | None, progress: Progress
) -> Iterator[Record]:
    """Yield the images of a folder in natural order; JPEG and PNG are taken as they are.

    Raises:
        SourceError: The folder has no image, or one that cannot be read.
    """
    files = images_in(path)
    begin_ns = _written_ns(files[0])
    for number, file in enumerate(files):
        progress(number, len(files))
        stamp_ns = begin_ns + round(number * 1e9 / (rate_hz or DEFAULT_HZ))
        try:
            yield stream.frame(_image(file.read_bytes()), stamp_ns)
        except OSError as error:
            raise SourceError(f"{file}: cannot be read: {error.strerror}") from None
        except (PayloadError, ValueError) as error:
            raise SourceError(f"{file}: {error}") from None


def _written_ns(file: Path) -> int:
    return max(0, file.stat().st_mtime_ns)  # a recording has no time before 1970


def _image(data: bytes) -> Picture:
    """Return an image, upright.

    Raises:
        PayloadError, ValueError: It is none, or damaged.
    """
    if data.startswith(codecs.PNG_START) or (
        data.startswith(codecs.JPEG_START) and as_stored(data) == data
    ):
        return picture_of(data)
    return decoded(data)
