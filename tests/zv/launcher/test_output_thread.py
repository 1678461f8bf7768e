"""Output that nobody reads stops nobody, and what is lost of it is counted."""

from __future__ import annotations

import fcntl
import logging
import os
import sys
from collections.abc import Iterator
from typing import TextIO

import pytest

from tests.support.waiting import DEADLINE_S, wait_until
from zv.launcher import output_thread
from zv.launcher.output_thread import ThreadedStream, written_on_threads

PIPE_BYTES = 4096


@pytest.fixture
def pipe() -> Iterator[tuple[int, TextIO]]:
    """A pipe with room for a page: the end to read, and a stream that writes the other one."""
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    with os.fdopen(writing, "w") as stream:
        yield reading, stream
    os.close(reading)


def read_until(reading: int, end: bytes) -> bytes:
    """Read until what was read ends so."""
    found = b""
    while not found.endswith(end):
        found += os.read(reading, 100_000)
    return found


def test_who_writes_does_not_wait_and_a_late_reader_gets_everything_in_order(pipe):
    reading, stream = pipe
    threaded = ThreadedStream(stream)
    for number in range(2000):
        print(f"line {number}", file=threaded, flush=True)
    assert not threaded.end(0)
    found = read_until(reading, b"line 1999\n")
    assert found == b"".join(b"line %d\n" % number for number in range(2000))
    assert threaded.end(DEADLINE_S)


def test_lines_that_are_lost_are_counted_where_they_are_missing(pipe, monkeypatch):
    monkeypatch.setattr(output_thread, "MOST_CHARACTERS", 10_000)
    reading, stream = pipe
    os.write(stream.fileno(), bytes(PIPE_BYTES))  # none of the lines leaves the queue
    threaded = ThreadedStream(stream)
    for number in range(2000):  # 10 characters each
        print(f"line {number:04}", file=threaded)
        if number == 0:
            wait_until(lambda: not threaded._texts)  # the thread waits for the reader with it
    found = read_until(reading, b"since nobody read them\n")[PIPE_BYTES:].decode().splitlines()
    assert found[:-1] == [f"line {number:04}" for number in range(1000)]
    assert found[-1] == "zv up: 1000 lines were lost here, since nobody read them"
    print("after", file=threaded)
    assert read_until(reading, b"after\n") == b"after\n"


def test_a_part_of_a_line_is_written_when_it_is_flushed(pipe):
    reading, stream = pipe
    threaded = ThreadedStream(stream)
    threaded.write("one\ntwo")
    assert read_until(reading, b"two") == b"one\ntwo"
    threaded.write("\x1b[2A")
    threaded.flush()
    assert os.read(reading, 100) == b"\x1b[2A"


def test_that_the_reader_is_gone_is_raised_by_a_later_line():
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as stream:
        threaded = ThreadedStream(stream)

        def is_raised() -> bool:
            try:
                print("line", file=threaded)
            except BrokenPipeError:
                return True
            return False

        wait_until(is_raised)


def test_raising_an_error_again_keeps_no_more_of_where_it_was_raised():
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as stream:
        threaded = ThreadedStream(stream)
        threaded.write("line\n")
        assert threaded.end(DEADLINE_S)
        depths = []
        for _ in range(3):
            with pytest.raises(BrokenPipeError) as caught:
                threaded.write("line\n")
            depths.append(len(caught.traceback))
    assert depths == [depths[0]] * 3


def test_the_streams_and_the_log_are_as_before_unless_nobody_reads(pipe, monkeypatch):
    reading, stream = pipe
    monkeypatch.setattr(output_thread, "END_S", 0.1)
    monkeypatch.setattr(sys, "stdout", stream)
    monkeypatch.setattr(sys, "stderr", stream)
    handler = logging.StreamHandler(stream)
    monkeypatch.setattr(logging.getLogger(), "handlers", [handler])
    with written_on_threads():
        logging.getLogger("it").warning("logged")
        assert handler.stream is sys.stderr
    assert (sys.stdout, sys.stderr, handler.stream) == (stream, stream, stream)
    assert os.read(reading, 100) == b"logged\n"
    with written_on_threads():
        print("x" * 2 * PIPE_BYTES)
    assert isinstance(sys.stdout, ThreadedStream)  # what is said now does not wait either


def test_that_the_last_line_was_not_written_is_raised(monkeypatch):
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        with pytest.raises(OSError, match="No space left"), written_on_threads():
            print("line")
        assert sys.stdout is full


def test_what_is_said_at_the_end_is_written_at_once_where_only_the_other_stream_is_stuck(
    pipe, monkeypatch, tmp_path
):
    monkeypatch.setattr(output_thread, "END_S", 0.1)
    with (tmp_path / "log").open("w") as log:
        monkeypatch.setattr(sys, "stdout", pipe[1])
        monkeypatch.setattr(sys, "stderr", log)
        with written_on_threads():
            print("x" * 2 * PIPE_BYTES)
        assert isinstance(sys.stdout, ThreadedStream)
        assert sys.stderr is log


def test_lines_of_both_streams_that_lead_to_one_place_stay_in_order(monkeypatch, tmp_path):
    with (tmp_path / "log").open("a") as stream, open(stream.fileno(), "a", closefd=False) as other:
        monkeypatch.setattr(sys, "stdout", stream)
        monkeypatch.setattr(sys, "stderr", other)
        with written_on_threads():
            for number in range(200):
                print(number, file=(sys.stdout, sys.stderr)[number % 2])
    assert (tmp_path / "log").read_text().split() == [str(number) for number in range(200)]
