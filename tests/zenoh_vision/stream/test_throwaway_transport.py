"""A second transport fits behind the intake: shared memory and a pipe instead of Zenoh."""

from __future__ import annotations

import os
import pickle
import struct
import threading
from multiprocessing.shared_memory import SharedMemory

import numpy as np

from tests.support.headers import NOW_NS, header
from zenoh_vision import Consumer, FrameCounters, FrameIntake, Header, Sample, queue

KEY, PLACES, SIZE = "vision/front/image", 4, 48 * 64 * 3


class Sender:
    def __init__(self, memory: SharedMemory, pipe: int) -> None:
        self._memory, self._pipe, self.free = memory, pipe, threading.Semaphore(PLACES)

    def send(self, number: int, found: Header, pixels: np.ndarray) -> None:
        assert self.free.acquire(timeout=5), "no place was given back"
        at = number % PLACES * SIZE
        self._memory.buf[at : at + SIZE] = pixels.tobytes()
        note = pickle.dumps((at, found.to_bytes()))
        os.write(self._pipe, struct.pack("!I", len(note)) + note)


def receive(memory: SharedMemory, pipe: int, intake: FrameIntake, free: threading.Semaphore):
    while head := os.read(pipe, 4):
        at, attachment = pickle.loads(os.read(pipe, struct.unpack("!I", head)[0]))
        lent = memory.buf[at : at + SIZE].toreadonly()

        def give_back(lent: memoryview = lent) -> None:
            free.release()

        intake.receive(Sample(KEY, lent, "", attachment, received_ns=NOW_NS, release=give_back))


def test_frames_come_through_shared_memory_uncopied_and_each_place_is_given_back():
    counters = FrameCounters()
    intake = FrameIntake(
        KEY, Consumer(counters, lambda error: None), queue(PLACES), raw=True, borrow=True
    )
    memory, (reading, writing) = SharedMemory(create=True, size=PLACES * SIZE), os.pipe()
    sender = Sender(memory, writing)
    arguments = (memory, reading, intake, sender.free)
    receiver = threading.Thread(target=receive, args=arguments, daemon=True)
    receiver.start()
    for seq in range(3 * PLACES):
        sender.send(seq, header(seq), np.full((48, 64, 3), seq, np.uint8))
        frame = intake.take(5, "pixels", None)
        assert (frame.header.seq, frame.borrowed, int(frame.pixels.mean())) == (seq, True, seq)
        counters.finish()
        del frame
    os.close(writing)
    receiver.join(5)
    intake.close()
    assert counters.snapshot() == {"received": 12, "processed": 12, "pending": 0}
    memory.unlink()
