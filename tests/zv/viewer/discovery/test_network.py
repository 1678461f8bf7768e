"""Long work on the event loop: in slices, between which the loop does other things."""

import asyncio

import pytest

from zv.viewer.discovery import network
from zv.viewer.discovery.network import Mailbox, in_slices

ITEMS = 100
ITEM_S = network.SLICE_S / 4
"""So five fit into a slice: it ends with the first that ends after it."""


class Work:
    """Work whose items each take a while by a clock of its own, and what the loop did meanwhile."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.at_s = 0.0
        self.done: list[object] = []
        self.longest = 0
        self._turn = 0
        monkeypatch.setattr(network, "time", self)

    def monotonic(self) -> float:
        return self.at_s

    def do(self, item: object) -> None:
        self.at_s += ITEM_S
        self.done.append(item)

    async def watch(self) -> None:
        """Note how many items are done between two turns of the loop."""
        self._turn = len(self.done)
        while len(self.done) < ITEMS:
            await asyncio.sleep(0)
            self.longest = max(self.longest, len(self.done) - self._turn)
            self._turn = len(self.done)


async def test_a_mailbox_is_emptied_in_slices_and_in_order(monkeypatch):
    work = Work(monkeypatch)
    mailbox = Mailbox(asyncio.get_running_loop(), lambda key, _: work.do(key[0]))
    for number in range(ITEMS):
        mailbox.put((f"n{number}", bool, ""), True)
    await asyncio.wait_for(work.watch(), 10)
    assert work.done == [f"n{number}" for number in range(ITEMS)]
    assert work.longest <= 5


async def test_what_is_read_in_slices_lets_the_loop_run_between_them(monkeypatch):
    work = Work(monkeypatch)

    async def read() -> None:
        async for number in in_slices(range(ITEMS)):
            work.do(number)

    await asyncio.wait_for(asyncio.gather(read(), work.watch()), 10)
    assert work.done == list(range(ITEMS))
    assert work.longest <= 5
