"""Which events are sent, and what of them."""

from __future__ import annotations

import pytest

from tests.support.headers import header
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.messages import TrackEvent
from zv.notify.mqtt import Mqtt
from zv.notify.notice import Choice, fields_of
from zv.notify.service import receivers_of
from zv.notify.settings import NotifySettings, kinds_of

KINDS = frozenset({"zone_entered", "line_crossed"})


def event(kind: str = "zone_entered", seq: int = 1, **fields: object) -> TrackEvent:
    about = {"header": header(seq), "event": kind, "id": 7, "zone": "belt", "x": 3.0, "y": 4.0}
    return TrackEvent(**{**about, **fields})


def test_an_event_is_sent_once_however_often_it_comes():
    choice = Choice()
    assert [choice.is_new(event()) for _ in range(3)] == [True, False, False]
    assert choice.is_new(event(seq=2))
    assert choice.is_new(event(id=8))
    assert choice.allow(event(), KINDS, 0, 1)


def test_other_kinds_are_left_out():
    assert not Choice().allow(event("started"), KINDS, 0, 1)


def test_after_an_event_others_of_its_place_wait_for_the_cooldown():
    choice = Choice()
    assert choice.allow(event(seq=1), KINDS, 10, 100)
    assert not choice.allow(event(seq=2), KINDS, 10, 109)
    assert choice.allow(event(seq=3, zone="door"), KINDS, 10, 109)
    assert choice.allow(event(seq=4), KINDS, 10, 110)


def test_the_fields_have_an_identity_and_no_nil():
    found = fields_of(event(inside=2, stamp_ns=99), 1234)
    assert found["uid"] == f"front-{found['epoch']}-1-zone_entered-7-belt"
    assert (found["inside"], found["stamp_ns"], found["received_ns"]) == (2, 99, 1234)
    assert None not in found.values()


def test_an_unknown_kind_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match="'zone_entred' is none of started, "):
        kinds_of("zone_entred")


def test_a_receiver_is_needed_and_a_broker_needs_a_host():
    with pytest.raises(ConfigurationError, match="nobody receives the events; allowed: --webhook"):
        receivers_of(NotifySettings())
    for url in ("mqtt://:1883", "mqtt://host:99999", "mqtt://[::1"):
        with pytest.raises(ConfigurationError, match="allowed: mqtt://HOST:PORT"):
            Mqtt(url, "p", "", "notify")
