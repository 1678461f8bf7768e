"""A program as a source: it writes MJPEG, YUV4MPEG2, H.264 or another stream to its output."""

from __future__ import annotations

import logging
import os
import select
import shlex
import shutil
import signal
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

import av
from av.error import FFmpegError

from zenoh_vision.error_text import printable, shortened, without_password
from zenoh_vision.errors import SourceError, SourceLost
from zenoh_vision.host.group_guard import GroupGuard, end_group, signal_group
from zenoh_vision.image.codecs import JPEG_START
from zv.camera.sources.base import Source, TimedPicture
from zv.camera.sources.jpeg_stream import JpegStream
from zv.camera.sources.kinds import COMMAND, source_words
from zv.camera.sources.libav import NoVideo
from zv.camera.sources.live_stream import LiveStream

log = logging.getLogger(__name__)

CHUNK_BYTES: Final = 1 << 20
GRACE_S: Final = 1.0
"""From SIGTERM to SIGKILL of a program that does not end."""
LAST_LINES: Final = 3
MAX_LINE: Final = 300
MAX_LINE_BYTES: Final = 4096
"""More than is shown, so that a password in a URL is recognised before the line is cut."""
QUICK: Final = {"analyzeduration": "100000", "probesize": "1000000", "fpsprobesize": "0"}


def open_command(spec: str, timeout_s: float, max_lag_s: Callable[[], float]) -> Source:
    """Start a program, and open the stream that it writes to its output.

    No shell runs it. It ends with this process, however that ends. Its pictures are stamped with
    the time at which they came.

    Args:
        spec: ``command:PROGRAM ARGS``, quoted as for a shell.
        timeout_s: Longest time without a picture.
        max_lag_s: Returns the longest time that a picture may wait here; 0 for no limit.

    Raises:
        SourceError: There is no such program, it ended, or it writes nothing usable.
    """
    shown = source_words(spec)
    program = Program(words_of(spec), timeout_s)
    try:
        start = program.first_bytes()
        if not start:
            raise SourceError(f"{shown}: {program.why_ended()}")
        if start.startswith((JPEG_START, b"--")):  # bare, or multipart
            program.end_opening()
            return JpegStream(program, shown, timeout_s, max_lag_s)
        return CommandVideo(program, shown, timeout_s, max_lag_s)
    except BaseException:
        program.close()
        raise


def words_of(spec: str) -> list[str]:
    """Return the program and its arguments.

    Raises:
        SourceError: There is no such program, or a quote is not closed.
    """
    text = spec.removeprefix(COMMAND)
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise SourceError(f"source: {source_words(spec)}: {error}") from None
    if not words:
        raise SourceError("source: command: names no program; allowed: command:PROGRAM ARGS")
    found = shutil.which(words[0])
    if found is None:
        raise SourceError(f"source: there is no program {shortened(words[0])} on PATH")
    return [found, *words[1:]]


class Program:
    """A program that writes a stream to its output; a ``Sender`` and a file.

    Until its opening has ended, a ``read`` waits for the end of the time to open at most.

    Args:
        words: The program and its arguments.
        timeout_s: Longest time to open.

    Attributes:
        name: Of the program, without its folder.

    Raises:
        SourceError: It cannot be started.
    """

    def __init__(self, words: list[str], timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._opens_until_s: float | None = time.monotonic() + timeout_s
        self.name = Path(words[0]).name
        self._ahead = b""
        self._errors: deque[str] = deque(maxlen=LAST_LINES)
        self._is_ended = False
        self._lock = threading.Lock()
        self._guard = GroupGuard(GRACE_S)
        try:
            self._process = subprocess.Popen(  # noqa: S603 - what the user configured
                words,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,  # so that what it starts ends too
                bufsize=0,
            )
        except OSError as error:
            raise SourceError(f"command {self.name}: {error.strerror}") from None
        self._guard.add(self._process.pid)
        assert self._process.stdout is not None
        self._output = self._process.stdout.fileno()
        self._listener = threading.Thread(target=self._listen, name="stderr", daemon=True)
        self._listener.start()

    def first_bytes(self) -> bytes:
        """Return the first bytes of the output, which are to come again; empty if it ended.

        Raises:
            SourceError: It writes nothing in time.
        """
        start = b""
        try:
            while len(start) < len(JPEG_START) and (chunk := self.read(CHUNK_BYTES)):
                start += chunk
        except TimeoutError:
            wait = f"no output for {self._timeout_s:g} s"
            raise SourceError(f"command {self.name}: {wait}") from None
        self._ahead = start
        return start

    def read(self, size: int) -> bytes:
        """Return at most so many bytes of the output, as soon as there are some.

        Raises:
            TimeoutError: The time to open is over.
        """
        if self._opens_until_s is not None:
            left_s = self._opens_until_s - time.monotonic()
            if left_s <= 0 or not (self._ahead or select.select([self._output], [], [], left_s)[0]):
                raise TimeoutError
        if self._ahead:
            found, self._ahead = self._ahead[:size], self._ahead[size:]
            return found
        return os.read(self._output, size)

    def end_opening(self) -> None:
        """Let each ``read`` wait for as long as nothing comes, from now on."""
        self._opens_until_s = None

    def chunks(self) -> Iterator[bytes]:
        """Yield the bytes of the output as they come."""
        while chunk := self.read(CHUNK_BYTES):
            yield chunk

    def why_ended(self) -> str:
        """Return how it ended, with the last lines of its error output."""
        try:
            status = self._process.wait(GRACE_S)
        except subprocess.TimeoutExpired:
            return "it closed its output"
        self._listener.join(GRACE_S)
        how = f"was ended by signal {-status}" if status < 0 else f"ended with status {status}"
        said = f": {' | '.join(self._errors)}" if self._errors else ""
        return f"it {how}{said}"

    def interrupt(self) -> None:
        """End it and all that it has started, and with it its output."""
        with self._lock:
            if self._is_ended:
                return
            self._is_ended = True
            group = self._process.pid
            signal_group(group, signal.SIGTERM)
            end_group(group, time.monotonic() + GRACE_S)
            self._process.wait()
            self._guard.close()

    def close(self) -> None:
        """End it, and close its pipes; safe to call twice."""
        self.interrupt()
        for pipe in (self._process.stdout, self._process.stderr):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()

    def _listen(self) -> None:
        """Log what it writes to its error output, and keep the last lines."""
        assert self._process.stderr is not None
        rest = b""
        with suppress(OSError, ValueError):  # it was closed
            while chunk := self._process.stderr.read(MAX_LINE_BYTES):
                *lines, rest = (rest + chunk).split(b"\n")
                for line in lines:
                    self._note(line)
                # What ends with CR is written over by what follows: ffmpeg's progress.
                rest = rest[rest.rstrip(b"\r").rfind(b"\r") + 1 :][:MAX_LINE_BYTES]
        self._note(rest)

    def _note(self, line: bytes) -> None:
        text = line.decode("utf-8", "replace").rstrip().rpartition("\r")[2]
        text = printable(without_password(text))[:MAX_LINE].strip()
        if text:
            self._errors.append(text)
            log.debug("%s: %s", self.name, text)


class CommandVideo:
    """Pictures of a program that writes a video which libav knows.

    Raises:
        SourceError: It does not.
    """

    live = True
    rate_hz: float | None = None

    def __init__(
        self, program: Program, shown: str, timeout_s: float, max_lag_s: Callable[[], float]
    ) -> None:
        self._program = program
        self._shown = shown
        self._timeout_s = timeout_s
        try:
            container = av.open(program, "r", options=QUICK, buffer_size=CHUNK_BYTES)
        except TimeoutError:
            raise SourceError(f"{shown}: no usable picture for {timeout_s:g} s") from None
        except (FFmpegError, ValueError) as error:
            reason = "it writes no video that libav knows"
            raise SourceError(f"{shown}: {reason}; {program.why_ended()}") from error
        program.end_opening()
        try:
            self._stream = LiveStream(container, timeout_s, max_lag_s)
        except NoVideo as error:
            container.close()
            raise SourceError(f"{shown}: no video: {error}") from None
        self.description = f"{shown} ({self._stream.summary})"

    def read(self) -> TimedPicture:
        """Return the next picture.

        Raises:
            SourceLost: The program ended, stalled, or writes nothing usable.
        """
        try:
            picture = self._stream.read()
        except TimeoutError:
            wait = f"no usable picture for {self._timeout_s:g} s"
            raise SourceLost(f"{self._shown}: {wait}") from None
        except FFmpegError as error:
            raise SourceLost(f"{self._shown}: {error.strerror}") from None
        if picture is None:
            raise SourceLost(f"{self._shown}: {self._program.why_ended()}")
        return picture

    def close(self) -> None:
        """End the program; safe to call twice."""
        self._program.interrupt()
        self._stream.close()
        self._program.close()
