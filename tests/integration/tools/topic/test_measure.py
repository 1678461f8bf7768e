"""``zv topic hz``, ``bw`` and ``delay``: figures, losses and verdicts."""

from __future__ import annotations

import json
import os
import re
import signal
import threading
import time
from collections.abc import Callable

import pytest
from pydantic import ValidationError

from tests.support.listening import Listener
from tests.support.publishing import (
    JPEG,
    Paced,
    counting,
    put_picture,
    wait_for_subscriber,
)
from tests.support.terminal import Terminal
from tests.support.waiting import wait_until
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet
from zenoh_vision.transport.connection import Connection
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession
from zv.tools.shared.statistics import StreamMonitor, StreamStatistics
from zv.tools.topic import measure
from zv.tools.topic.measure import run_bw, run_delay, run_hz
from zv.tools.topic.options import (
    BwOptions,
    DelayOptions,
    HzOptions,
    MeasureOptions,
)


def arrived(
    endpoint: str, patterns: list[str], send: Callable[[], None], count: int
) -> list[StreamStatistics]:
    """Return the streams after ``send`` has sent so many messages that match."""
    with ToolSession(Connection(connect=endpoint, timeout_s=20)) as session:
        monitor = StreamMonitor(session, patterns)
        # The router has the subscription before it answers a later query.
        session.ask("@/*/router")
        send()

        def all_there() -> bool:
            monitor.update()
            return sum(stream.samples.count for stream in monitor.streams) >= count

        wait_until(all_there)
        return monitor.streams


def test_lost_repeated_and_late_are_told_apart_by_publisher(endpoint, client):
    def send() -> None:
        for seq in (0, 1, 4, 3, 4, 6):  # 2 and 5 never come, 3 is late, 4 comes twice
            put_picture(client, "vision/c/image/compressed", seq)
        for seq in (10, 20):
            put_picture(client, "vision/c/image/compressed", seq, node="other")
        client.put("vision/c/image/compressed", b"bare", encoding=JPEG)

    streams = arrived(endpoint, ["vision/*/image/compressed"], send, 9)
    key = "vision/c/image/compressed"
    assert {(s.key, s.node): (s.samples.count, s.lost, s.gaps.repeated) for s in streams} == {
        (key, "camera_c"): (6, 2, 1),
        (key, "other"): (2, 9, 0),
        (key, None): (1, None, 0),
    }


def test_a_key_that_two_patterns_match_counts_once(endpoint, client):
    def send() -> None:
        for seq in range(20):
            put_picture(client, "vision/c/image/compressed", seq)
        client.put("vision/c/end", b"")

    patterns = ["vision/*/image/compressed", "vision/c/**", "*/c/end"]
    streams = arrived(endpoint, patterns, send, 21)
    assert {stream.key: stream.samples.count for stream in streams} == {
        "vision/c/image/compressed": 20,
        "vision/c/end": 1,
    }


def test_hz_is_the_rate_that_a_plain_subscriber_sees(client, zv):
    listener = Listener(client, "vision/c/image/compressed")
    with Paced(40, counting(client, "vision/c/image/compressed")):
        started_s = time.monotonic()
        (line,) = zv(HzOptions(keys=("vision/c/**",), for_=1.5), as_json=True)
        took_s = time.monotonic() - started_s
    found = json.loads(line)
    # The tool's messages are some of the listener's in a row: which, it does not say.
    times_s, count = [message.at_s for message in listener.messages], found["messages"]
    assert count > 1
    expected = [
        (count - 1) / (last_s - first_s)
        for first_s, last_s in zip(times_s, times_s[count - 1 :], strict=False)
    ]
    assert any(found["rate_hz"] == pytest.approx(rate_hz, rel=0.1) for rate_hz in expected)
    assert (found["key"], found["node"]) == ("vision/c/image/compressed", "camera_c")
    assert (found["lost"], found["repeated"], found["restarts"]) == (0, 0, 0)
    assert found["min_ms"] <= found["p50_ms"] <= found["p99_ms"] <= found["max_ms"]
    assert 1.4 < found["seconds"] <= max(1.6, took_s)  # longer only on a busy machine


def test_bw_is_the_rate_times_the_size_and_delay_the_age(client, zv):
    late = {"stamp_ns": time.time_ns() - 3_600_000_000_000}  # an hour old
    send = counting(client, "vision/c/image/compressed", lambda *a: put_picture(*a, **late))
    with Paced(40, send):
        bw = json.loads(zv(BwOptions(keys=("vision/c/**",), for_=0.7), as_json=True)[0])
        delay = json.loads(zv(DelayOptions(keys=("vision/c/**",), for_=0.7), as_json=True)[0])
    assert (bw["min_kb"], bw["max_kb"], bw["std_kb"]) == (1, 1, 0)  # 1000 bytes each
    hz = bw["messages"] / bw["seconds"]
    assert 1 < bw["kb_per_s"] <= 1.5 * hz  # 1 kB each
    assert delay["mean_ms"] == pytest.approx(3_600_000, rel=0.01)
    assert delay["p99_ms"] >= delay["p50_ms"] >= delay["min_ms"] >= 3_600_000


def test_what_is_expected_and_met_ends_well_and_what_is_not_is_1(client, zv):
    key = "vision/c/image/compressed"
    with Paced(20, counting(client, key)):
        assert zv(HzOptions(keys=(key,), for_=1.0, expect=20, tolerance=0.9))
        with pytest.raises(
            ExpectationNotMet, match=r"Hz, expected 5400\.00 Hz to 6600\.00 Hz"
        ) as caught:
            zv(HzOptions(keys=(key,), for_=0.4, expect=6000))
        assert caught.value.exit_status == 1
        with pytest.raises(ExpectationNotMet, match=r"kB/s, expected 900.00 kB/s"):
            zv(BwOptions(keys=(key,), for_=0.4, expect=1e6))
        with pytest.raises(ExpectationNotMet, match=r"p99 .* ms, allowed 1e-05 ms"):
            zv(DelayOptions(keys=(key,), for_=0.4, at_most=1e-8))
        with pytest.raises(ExpectationNotMet, match=r"ms, expected 900\.00 ms"):
            zv(DelayOptions(keys=(key,), for_=0.4, expect=1.0))


def test_a_stream_that_stops_is_not_at_its_rate_however_fast_it_was(client, zv):
    key = "vision/c/image/compressed"

    def burst() -> None:
        wait_for_subscriber(client, key)
        for seq in range(30):
            put_picture(client, key, seq)
            time.sleep(0.005)

    sender = threading.Thread(target=burst)
    sender.start()
    with pytest.raises(ExpectationNotMet, match="expected"):
        zv(HzOptions(keys=(key,), for_=1.0, expect=200, tolerance=0.5))
    sender.join()


def test_a_key_on_which_nothing_comes_is_1_beside_another_that_is_well(client, zv):
    key = "vision/c/image/compressed"
    publisher = client.declare_publisher("vision/d/image/compressed")
    with Paced(20, counting(client, key)), pytest.raises(ExpectationNotMet) as caught:
        zv(HzOptions(keys=(key, "vision/d/**"), for_=0.5))
    assert "nothing arrived on vision/d/**, although" in str(caught.value)
    publisher.undeclare()


def test_samples_without_a_header_have_a_rate_but_no_delay(client, zv):
    with Paced(30, lambda: client.put("other/x", b"123")):
        (line,) = zv(HzOptions(keys=("other/**",), for_=0.5))
        assert line.startswith("other/x [no header] ")
        assert "lost" not in line
        (line,) = zv(DelayOptions(keys=("other/**",), for_=0.5))
        assert line.startswith("other/x [no header] - ")
        with pytest.raises(ExpectationNotMet, match="have no header"):
            zv(DelayOptions(keys=("other/**",), for_=0.5, expect=1.0))


def test_a_mistyped_key_names_the_near_one(client, zv):
    publisher = client.declare_publisher("vision/c/image/compressed")
    with pytest.raises(ExpectationNotMet, match=r"did you mean vision/c/image/compressed\?"):
        zv(HzOptions(keys=("vision/c/imgae/compressed",), for_=0.3), timeout_s=2.0)
    publisher.undeclare()


def test_what_is_no_key_is_wrong_use(zv):
    with pytest.raises(ConfigurationError, match="not a key expression"):
        zv(HzOptions(keys=("vision//image",)))


def test_told_to_stop_before_the_time_is_over_there_is_no_verdict(client, zv):
    key = "vision/c/image/compressed"
    publisher = client.declare_publisher(key)
    sent = iter(range(10**9))

    def interrupt_when_heard() -> None:
        if publisher.matching_status.matching:
            put_picture(client, key, seq := next(sent))
            if seq == 10:  # once: after its end the signal would end the tests
                os.kill(os.getpid(), signal.SIGINT)

    stopped = pytest.raises(ExpectationNotMet, match=r"stopped after .* of 60 s: no result")
    with Paced(50, interrupt_when_heard), stopped:
        zv(HzOptions(keys=(key,), for_=60.0, expect=20, tolerance=0.99))
    publisher.undeclare()


class Heard(Output):
    """Keeps the notes; the first one ends the tool as Ctrl-C does."""

    def __init__(self) -> None:
        super().__init__()
        self.notes: list[str] = []

    def note(self, text: str) -> None:
        self.notes.append(text)
        os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.parametrize("run", [run_hz, run_bw, run_delay])
def test_it_says_which_key_it_waits_for_beside_one_that_is_well(endpoint, client, monkeypatch, run):
    monkeypatch.setattr(measure, "SILENT_S", 0.3)
    monkeypatch.setattr(measure, "PERIOD_S", 0.05)
    key, heard = "vision/c/image/compressed", Heard()
    with Paced(50, counting(client, key)):
        run(HzOptions(keys=(key, "vision/d/*")), Connection(endpoint, timeout_s=20), heard)
    (note,) = (each for each in heard.notes if "matches vision/d/*" in each)
    assert note.startswith("nothing matches vision/d/*")
    assert note.endswith(" waiting for it (Ctrl-C ends it, --for 5s limits it)")


def test_before_a_verdict_it_says_that_it_waits_for_a_first_message(endpoint, monkeypatch):
    monkeypatch.setattr(measure, "SILENT_S", 0.1)
    heard = Heard()
    with pytest.raises(ExpectationNotMet, match="no result"):
        run_hz(HzOptions(keys=("a/b",), expect=1), Connection(endpoint, timeout_s=30), heard)
    assert heard.notes == ["nothing arrived yet; waiting up to 30 s"]


def test_on_a_terminal_hz_is_one_table_that_is_drawn_anew_until_ctrl_c(endpoint, client):
    key = "vision/c/image/compressed"
    terminal = Terminal(
        ["topic", "hz", key, "--connect", endpoint], columns=140, variables={"NO_COLOR": "1"}
    )
    with Paced(20, counting(client, key)):
        shown = terminal.until(lambda text: text.count("rate Hz") >= 3)
    terminal.press_ctrl_c()
    assert terminal.end() == 0
    assert "camera_c" in shown
    assert re.search(r"\x1b\[\d*A", terminal.raw)  # the cursor goes up to draw over the last one
    assert not re.search(r"\x1b\[[0-9;]*3[0-7]m", terminal.raw)  # and no colour is set


@pytest.mark.parametrize("options", [HzOptions, BwOptions, DelayOptions])
def test_a_tolerance_of_nothing_is_refused(options: type[MeasureOptions]):
    with pytest.raises(ValidationError, match="--tolerance needs an --expect"):
        options(tolerance=0.05)
