"""What is sent when, on a clock that the test moves, and the keys that control it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import pytest

from tests.support.clocks import SteppedClock
from zv.bag.record import Record
from zv.bag.replayed import Pass
from zv.tools.bag.keyboard import words_of
from zv.tools.bag.player import Player, Wish

S = 10**9
BEGIN = 1_700_000_000 * S
FRAME, RESULT = "vision/front/image/compressed", "vision/front/centroid"


class ListTape:
    """A recording in memory: a frame every second, and its result half a second later."""

    def __init__(self, seconds: int) -> None:
        self.records = [
            Record(key, str(second).encode(), log_time_ns=BEGIN + second * S + late)
            for second in range(seconds)
            for key, late in ((FRAME, 0), (RESULT, S // 2))
        ]
        self.begin_ns = BEGIN
        self.end_ns = self.records[-1].log_time_ns

    def before(self, moment_ns: int) -> list[Record]:
        return []

    def after(self, moment_ns: int) -> Iterator[Record]:
        return iter([each for each in self.records if each.log_time_ns >= moment_ns])


class Play:
    """A player, and what it has sent: what, when, and in which pass.

    Args:
        seconds: Length of the recording.
        wishes: Returns the wish at a second of the clock.
        until_s: When it is stopped.
        held: How long each record is held back, seconds, by its name.
    """

    def __init__(
        self,
        seconds: int,
        wishes: Callable[[float], Wish],
        until_s: float = 1000.0,
        held: Mapping[str, float] | None = None,
    ) -> None:
        self.clock = SteppedClock()
        self.sent: list[tuple[str, float]] = []
        self.passes: list[int] = []
        self._start_ns = self.clock.now_ns

        def wish() -> Wish:
            return wishes(self.now_s)

        self.player = Player(
            ListTape(seconds),
            wish,
            self._send,
            lambda record: record.key == FRAME,
            lambda: self.now_s >= until_s,
            self.clock,
            hold_back=lambda record, _: self.clock.step((held or {}).get(name_of(record), 0.0)),
        )
        # It waits on the machine's clock: let that pass at once.
        self.player.changed.wait = self.clock.step  # type: ignore[method-assign]
        self.player.run()

    @property
    def now_s(self) -> float:
        return (self.clock.now_ns - self._start_ns) / 1e9

    def _send(self, record: Record, run: Pass) -> None:
        self.sent.append((name_of(record), round(self.now_s, 3)))
        self.passes.append(run.begun_ns)


def name_of(record: Record) -> str:
    return f"{'f' if record.key == FRAME else 'r'}{record.payload.decode()}"


def test_records_are_sent_in_their_pace():
    play = Play(2, lambda _: Wish())
    assert play.sent == [("f0", 0.0), ("r0", 0.5), ("f1", 1.0), ("r1", 1.5)]


def test_twice_the_speed_takes_half_the_time():
    assert Play(2, lambda _: Wish(2.0)).sent[-1] == ("r1", 0.75)


def test_as_fast_as_possible_takes_no_time():
    assert {at_s for _, at_s in Play(9, lambda _: Wish(0.0)).sent} == {0.0}


def test_a_pause_lasts_until_it_ends():
    play = Play(2, lambda now_s: Wish(paused=0.6 <= now_s < 5.6))
    assert [name for name, _ in play.sent] == ["f0", "r0", "f1", "r1"]
    assert 5.9 < play.sent[2][1] < 6.4  # 0.5 s were left when it was paused


def test_a_step_sends_a_frame_and_what_follows_it():
    def wish(now_s: float) -> Wish:
        return Wish(paused=True, steps=(now_s >= 2) + (now_s >= 4))

    play = Play(9, wish, until_s=10)
    assert [name for name, _ in play.sent] == ["f0", "r0", "f1", "r1"]
    assert [round(at_s) for _, at_s in play.sent] == [2, 2, 4, 4]


def test_a_jump_begins_another_pass_there():
    play = Play(5, lambda now_s: Wish(position_s=0.0 if now_s < 1.2 else 3.0))
    assert [name for name, _ in play.sent] == ["f0", "r0", "f1", "f3", "r3", "f4", "r4"]
    assert len(set(play.passes)) == 2
    assert play.passes == sorted(play.passes)


def test_a_jump_while_paused_shows_the_frame_that_is_there():
    def wish(now_s: float) -> Wish:
        return Wish(paused=True, position_s=1.2 if now_s >= 2 else 0.0)

    play = Play(5, wish, until_s=10)
    assert [name for name, _ in play.sent] == ["r1", "f2", "r2"]


def test_a_record_that_is_held_back_is_not_sent_after_a_jump():
    play = Play(5, lambda now_s: Wish(position_s=3.0 * (now_s > 1)), held={"f1": 3.0})
    assert [name for name, _ in play.sent] == ["f0", "r0", "f3", "r3", "f4", "r4"]


def test_a_record_that_is_held_back_waits_for_the_end_of_a_pause():
    play = Play(2, lambda now_s: Wish(paused=1 < now_s < 9), held={"f1": 3.0})
    assert [name for name, _ in play.sent] == ["f0", "r0", "f1", "r1"]
    assert play.sent[2][1] >= 9


def test_a_record_that_is_held_back_is_not_sent_after_the_end():
    play = Play(5, lambda _: Wish(), until_s=2, held={"f1": 3.0})
    assert [name for name, _ in play.sent] == ["f0", "r0"]


def test_a_replay_goes_on_in_its_pace_after_a_record_was_held_back():
    play = Play(3, lambda _: Wish(), held={"f1": 3.0})
    assert play.sent[2:] == [("f1", 3.5), ("r1", 4.0), ("f2", 4.5), ("r2", 5.0)]


def test_a_jump_to_the_same_place_begins_there_again():
    play = Play(2, lambda now_s: Wish(position_s=1e-5 if now_s > 1.2 else 0.0))
    assert [name for name, _ in play.sent] == ["f0", "r0", "f1", "f0", "r0", "f1", "r1"]


def test_a_jump_back_works_while_paused_at_the_end():
    play = Play(2, lambda now_s: Wish(1.0, paused=1.5 <= now_s < 3, position_s=float(now_s > 2)))
    assert [name for name, _ in play.sent] == ["f0", "r0", "f1", "f1", "r1"]


def test_a_loop_repeats_the_recording_in_passes_of_its_own():
    play = Play(1, lambda _: Wish(loop=True), until_s=1.2)
    assert [name for name, _ in play.sent] == ["f0", "r0", "f0", "r0", "f0"]
    assert len(set(play.passes)) == 3


@pytest.mark.parametrize(
    ("data", "words", "held"),
    [
        (b" ", ["pause"], b""),
        (b"s s", ["step", "pause", "step"], b""),
        (b"\x1b[C\x1b[D", ["forward", "back"], b""),
        (b"\x1b[", [], b"\x1b["),
        (b"q\x1b", ["quit"], b"\x1b"),
        (b"xyz\xff0", ["begin"], b""),
        (b"\x1b[Z", [], b""),
    ],
)
def test_keys_become_words(data: bytes, words: list[str], held: bytes):
    assert words_of(data) == (words, held)
