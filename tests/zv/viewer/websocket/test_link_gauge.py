"""When a link limits what is sent, and what it carries then."""

from zv.viewer.websocket.link_gauge import LinkGauge


def test_a_link_that_sending_waits_for_is_measured_every_two_seconds():
    gauge = LinkGauge(100.0)
    found = [gauge.add(31_250, 100 + 0.25 * each, 100.25 + 0.25 * each) for each in range(16)]
    assert [each for each, rate in enumerate(found) if rate] == [7, 15]
    assert found[7] == found[15] == 1_000_000


def test_a_link_that_is_idle_for_most_of_the_time_does_not_limit():
    gauge = LinkGauge(0.0)
    assert not any(gauge.add(10**6, each + 0.5, each + 1.0) for each in range(20))
