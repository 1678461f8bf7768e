"""What a replay sends of a record."""

from __future__ import annotations

from dataclasses import replace

import msgpack
import pytest

from tests.support.recordings import BEGIN_NS, centroids, frames
from zv.bag.record import Record
from zv.bag.replayed import Names, Pass, Replayed

S = 10**9
NOW_NS = BEGIN_NS + 86_400 * S
FRAME = frames(8)[7]
RESULT = centroids([FRAME])[0]
RUN = Pass(NOW_NS, lambda moment_ns: NOW_NS + moment_ns - BEGIN_NS)


def header_of(attachment: bytes | None) -> dict[str, object]:
    assert attachment is not None
    found: dict[str, object] = msgpack.unpackb(attachment)
    return found


def test_bytes_and_stamps_stay_and_the_attachment_is_marked():
    sent = Replayed(Names()).sample(FRAME, RUN, NOW_NS + 5)
    assert (sent.key, sent.payload) == (FRAME.key, FRAME.payload)
    mark = {"replay": NOW_NS, "replayed_ns": NOW_NS + 5}
    assert header_of(sent.attachment) == FRAME.header | mark


def test_in_lockstep_the_mark_says_so():
    sent = Replayed(Names(), lockstep=True).sample(FRAME, RUN, NOW_NS)
    assert header_of(sent.attachment)["lockstep"] is True


@pytest.mark.parametrize("record", [FRAME, RESULT], ids=["frame", "result"])
def test_without_a_mark_every_byte_stays(record: Record):
    sent = Replayed(Names(), mark=False).sample(record, RUN, NOW_NS)
    assert (sent.key, sent.payload, sent.attachment) == (
        record.key,
        record.payload,
        record.attachment,
    )


def test_another_camera_has_its_name_in_key_attachment_and_message():
    sent = Replayed(Names({"front": "left"})).sample(RESULT, RUN, NOW_NS)
    assert sent.key == "vision/left/centroid"
    assert header_of(sent.attachment)["camera"] == "left"
    fields = msgpack.unpackb(sent.payload)
    assert fields["header"]["camera"] == "left"
    assert fields["header"]["seq"] == 7


def test_what_a_relay_sent_has_no_origin_under_another_name():
    header = {**FRAME.header, "origin": "back"}
    record = replace(FRAME, attachment=msgpack.packb(header))
    for names, origin in (({}, "back"), ({"front": "left"}, None)):
        sent = Replayed(Names(names)).sample(record, RUN, NOW_NS)
        assert header_of(sent.attachment)["origin"] == origin


def test_another_namespace_changes_the_key_only():
    replayed = Replayed(Names(namespaces={"vision": "lab"}))
    sent = replayed.sample(RESULT, RUN, NOW_NS)
    assert (sent.key, sent.payload) == ("lab/front/centroid", RESULT.payload)
    assert Names(namespaces={"vision": "lab"}).key("@vision/node/a") == "@lab/node/a"


def test_renewed_stamps_are_those_of_now_and_the_same_for_a_frame_and_its_results():
    replayed = Replayed(Names(), renew=True)
    frame = header_of(replayed.sample(FRAME, RUN, NOW_NS).attachment)
    result = replayed.sample(RESULT, RUN, NOW_NS)
    # It arrived 3 ms after its capture, and is sent when that arrival is due.
    assert frame["stamp_ns"] == NOW_NS + 7 * S // 30
    assert "replay" not in frame
    assert header_of(result.attachment)["stamp_ns"] == frame["stamp_ns"]
    assert msgpack.unpackb(result.payload)["header"]["stamp_ns"] == frame["stamp_ns"]
    assert header_of(result.attachment)["epoch"] == frame["epoch"] == NOW_NS


def test_renewed_epochs_differ_between_passes_and_between_recorded_epochs():
    replayed = Replayed(Names(), renew=True)
    reopened = frames(1, epoch=BEGIN_NS + 99 * S)[0]
    later = Pass(NOW_NS + 60 * S, RUN.due_ns)
    runs = ((FRAME, RUN), (reopened, RUN), (FRAME, later))
    epochs = [
        header_of(replayed.sample(record, run, NOW_NS).attachment)["epoch"] for record, run in runs
    ]
    assert epochs == [NOW_NS, NOW_NS + 1, NOW_NS + 60 * S]


@pytest.mark.parametrize("attachment", [None, b"", b"\x01", b"\x81\xa1a\x01"])
def test_what_has_no_header_stays_as_it_is(attachment: bytes | None):
    record = Record("robot/odometry", b"\x01\x02", "text/plain", attachment)
    sent = Replayed(Names({"front": "left"}), renew=True).sample(record, RUN, NOW_NS)
    assert (sent.key, sent.payload, sent.attachment) == (
        "robot/odometry",
        b"\x01\x02",
        attachment,
    )


@pytest.mark.parametrize("changes", [{"epoch": {}}, {"seq": [1]}, {"camera": 5}, {"stamp_ns": ""}])
def test_what_is_not_quite_a_header_stays_as_it_is(changes: dict[str, object]):
    record = replace(FRAME, attachment=msgpack.packb(FRAME.header | changes))
    sent = Replayed(Names({"front": "left"}), renew=True).sample(record, RUN, NOW_NS)
    assert (sent.payload, sent.attachment) == (record.payload, record.attachment)


def test_a_stamp_far_in_the_future_is_moved_as_far_as_its_field_goes():
    record = replace(FRAME, attachment=msgpack.packb(FRAME.header | {"stamp_ns": 2**64 - 1}))
    sent = Replayed(Names(), renew=True).sample(record, RUN, NOW_NS)
    assert header_of(sent.attachment)["stamp_ns"] == 2**63 - 1
