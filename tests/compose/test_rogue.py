"""A client that sends nonsense on every key: all live, all is counted, nobody's frames suffer."""

from __future__ import annotations

import time
from itertools import cycle

import pytest
import zenoh

from tests.support.containers import rogue
from tests.support.containers.stack import SERVICES, Stack
from tests.support.containers.witness import IMAGE, STREAMS, Witness, assert_whole
from tests.support.listening import ask, balance, drops, open_client
from tests.support.publishing import Paced
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.compose, pytest.mark.timeout(1500)]
RATE_HZ = 200.0
LASTS_S = 30.0


def test_malformed_payloads_at_200_a_second_on_every_key_for_30_s(stack: Stack, witness: Witness):
    starts = {service: stack.starts(service) for service in SERVICES}
    before = {node: witness.counters(node) for node in rogue.NODES}
    began_s = time.monotonic()
    with open_client(stack.endpoint) as session:
        todo = zip(cycle(rogue.keys()), rogue.malformed(), strict=False)
        sent: dict[str, int] = dict.fromkeys(rogue.keys(), 0)

        def send() -> None:
            key, (payload, attachment) = next(todo)
            # A put, and a query with the same payload: parameters are set by query.
            session.put(key, payload, attachment=attachment)
            if key.startswith("@"):
                session.get(key, zenoh.handlers.RingChannel(1), payload=payload, timeout=1.0)
            sent[key] += 1

        with Paced(RATE_HZ, send) as pace:
            wait_until(lambda: time.monotonic() - began_s > LASTS_S, LASTS_S + 10)
        ended_s = time.monotonic()
        session.delete(IMAGE)
    print(f"{pace.calls} samples on {len(sent)} keys")
    assert pace.calls > 0.8 * RATE_HZ * LASTS_S
    witness.flows(30, after_s=ended_s)

    assert {service: stack.starts(service) for service in SERVICES} == starts
    stack.wait_until_healthy()
    for node in rogue.NODES:
        assert ask(witness.session, f"@vision/node/{node}")
        counters = witness.counters(node)
        assert balance(counters) == 0
        if node != "camera_front":
            grown = {
                name: value - before[node].get(name, 0)
                for name, value in counters.items()
                if name.startswith("dropped.")
            }
            print(node, {name: value for name, value in grown.items() if value})
            # Everything that is sent on the key it reads is dropped, under names of its own;
            # but what is only a bare picture, without a header, is a picture.
            assert drops(counters) - drops(before[node]) >= 0.6 * sent[IMAGE]
            assert len([name for name, value in grown.items() if value]) >= 6
    frames = [one for one in witness[IMAGE].after(began_s) if one.at_s < ended_s]
    missing = frames[-1].seq - frames[0].seq + 1 - len(frames)
    print(f"camera: {missing} of {len(frames)} missing")
    assert missing <= 0.03 * len(frames)
    for key in STREAMS:
        seen = [one for one in witness[key].after(began_s) if one.at_s < ended_s]
        assert_whole(seen)
        share = len(seen) / len(frames)
        print(f"{key}: {share:.1%}, oldest {max(one.age_s for one in seen) * 1000:.0f} ms")
        # A rogue's frame in the slot displaces a good one now and then, counted as overwritten.
        assert share >= 0.95
