"""A long run of all containers with a random fault every 10 s, and a report of what it did.

``make soak``, or ``python -m tests.compose.soak --minutes 20 --seed 1``. The same seed makes the
same faults. Ends with status 1 if a claim did not hold: memory that grows, a frame that is old,
counters that do not balance, a stream that is not back.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

from tests.support.containers.stack import OURS, SERVICES, Stack, run
from tests.support.containers.witness import STREAMS, Witness
from tests.support.listening import balance
from tests.support.processes import ROOT

EVERY_S = 10.0
OLD_S = 0.4
SLOPE_MB_PER_H = 30.0
RECOVERY_S = 15.0


@dataclass
class Record:
    """What one fault did."""

    kind: str
    began_s: float
    possible_s: float  # from when on everything could work again
    back_s: float


@dataclass
class Memory:
    """Samples of a process's memory; a new life of the process begins a new series."""

    lives: list[list[tuple[float, float]]] = field(default_factory=list)
    pid: int = 0

    def note(self, pid: int, at_s: float, mb: float) -> None:
        """Take note of one reading."""
        if pid != self.pid:
            self.pid = pid
            self.lives.append([])
        self.lives[-1].append((at_s, mb))

    def slope(self) -> float | None:
        """Return MB per hour over all lives, each without its first 20 s; None if too short."""
        top = bottom = span_s = 0.0
        for life in self.lives:
            settled = [(t, mb) for t, mb in life if t - life[0][0] > 20]
            if len(settled) < 5:
                continue
            mean_t = sum(t for t, _ in settled) / len(settled)
            mean_mb = sum(mb for _, mb in settled) / len(settled)
            top += sum((t - mean_t) * (mb - mean_mb) for t, mb in settled)
            bottom += sum((t - mean_t) ** 2 for t, _ in settled)
            span_s += settled[-1][0] - settled[0][0]
        return 3600 * top / bottom if span_s > 60 else None


def hold(seconds: float) -> None:
    """Let a fault last."""
    time.sleep(seconds)


def faults(stack: Stack, rng: random.Random) -> dict[str, Callable[[], float]]:
    """Return the faults by name; each returns when everything could work again."""

    def crash(service: str) -> Callable[[], float]:
        def act() -> float:
            stack.crash(service)
            return stack.wait_for_router() if service == "router" else time.monotonic()

        return act

    def freeze(service: str) -> Callable[[], float]:
        def act() -> float:
            container = stack.container(service)
            run("docker", "pause", container)
            hold(rng.uniform(0.5, 5))
            run("docker", "unpause", container)
            return time.monotonic()

        return act

    def cut(service: str) -> Callable[[], float]:
        def act() -> float:
            stack.cut_off(service)
            hold(rng.uniform(0.5, 5))
            stack.reconnect(service)
            return time.monotonic()

        return act

    def anew() -> float:
        stack.compose("rm", "-sf", "router")
        stack.compose("up", "-d", "--no-build", "router")
        return stack.wait_for_router()

    return {
        **{f"crash {service}": crash(service) for service in SERVICES},
        **{f"freeze {service}": freeze(service) for service in SERVICES},
        **{f"cut off {service}": cut(service) for service in OURS},
        "router anew": anew,
    }


def soak(minutes: float, seed: int) -> bool:
    """Run, break, report; return whether all claims held."""
    rng = random.Random(seed)
    records: list[Record] = []
    memory = {service: Memory() for service in SERVICES}
    unbalanced = 0
    with Stack(ROOT) as stack:
        stack.wait_until_healthy()
        with Witness(stack.endpoint) as witness:
            witness.flows(30)
            began_s = time.monotonic()
            actions = faults(stack, rng)
            next_s = began_s + EVERY_S
            while time.monotonic() - began_s < minutes * 60:
                for service in SERVICES:
                    try:
                        mb = stack.resident_mb(service)
                        memory[service].note(stack.worker(service), time.monotonic(), mb)
                    except (OSError, IndexError, ValueError):
                        continue  # between two lives
                if time.monotonic() < next_s:
                    hold(1.0)
                    continue
                next_s += EVERY_S
                kind = rng.choice(sorted(actions))
                fault_s = time.monotonic()
                possible_s = actions[kind]()
                back_s = witness.back_s(possible_s)
                records.append(Record(kind, fault_s, possible_s, back_s))
                print(
                    f"{fault_s - began_s:6.0f} s  {kind:16} back after {back_s:.2f} s", flush=True
                )
            stack.wait_until_healthy()
            witness.flows(30, after_s=time.monotonic())
            for service in OURS:
                witness.counters(f"{service}_front")
            reports = [m.body for m in witness.health.messages if m.at_s > began_s]
            unbalanced = sum(1 for body in reports if balance(body["counters"]))
            return report(witness, began_s, records, memory, len(reports), unbalanced)


def report(
    witness: Witness,
    began_s: float,
    records: list[Record],
    memory: dict[str, Memory],
    reports: int,
    unbalanced: int,
) -> bool:
    """Print what was found, and return whether it is as claimed."""
    held = not unbalanced
    print(f"\n{len(records)} faults; recovery in seconds, worst by kind:")
    for kind in sorted({record.kind for record in records}):
        took = sorted(record.back_s for record in records if record.kind == kind)
        print(f"  {kind:16} {len(took):3} times, median {took[len(took) // 2]:.2f}, "
              f"worst {took[-1]:.2f}")  # fmt: skip
    worst_s = max(record.back_s for record in records)
    held &= worst_s < RECOVERY_S
    for key in STREAMS:
        seen = witness[key].after(began_s)
        identities = [(one.epoch, one.seq) for one in seen]
        twice = len(identities) - len(set(identities))
        # What a process that was frozen had in work or in its socket is finished after the thaw,
        # as it was: that is the fault's age, not the system's.
        thaws = [
            (record.began_s, record.possible_s + 0.5)
            for record in records
            if not record.kind.startswith("crash")
        ]
        free = [one for one in seen if not any(a < one.at_s < b for a, b in thaws)]
        oldest_s = max(one.age_s for one in free)
        disorder = sum(1 for a, b in pairwise(identities) if b < a and a[0] == b[0])
        print(
            f"  {key}: {len(seen)} frames, {len({e for e, _ in identities})} epochs, oldest "
            f"{oldest_s * 1000:.0f} ms ({max(one.age_s for one in seen) * 1000:.0f} ms with those "
            f"that a thaw let go), {twice} twice, {disorder} out of order"
        )
        held &= not twice and not disorder and oldest_s < OLD_S
    for service, series in memory.items():
        slope = series.slope()
        last = series.lives[-1][-1][1]
        words = "too short to tell" if slope is None else f"{slope:+.1f} MB per hour"
        print(f"  {service}: {last:.0f} MB at the end, {len(series.lives)} lives, {words}")
        held &= slope is None or slope < SLOPE_MB_PER_H
    print(f"  {reports} health reports, {unbalanced} that do not balance")
    print(
        f"  worst recovery {worst_s:.2f} s; {'all claims held' if held else 'A CLAIM DID NOT HOLD'}"
    )
    return held


def main() -> int:
    """Read the flags and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    Stack(ROOT).compose("build")
    return 0 if soak(given.minutes, given.seed) else 1


if __name__ == "__main__":
    sys.exit(main())
