"""What is no message, and what a message leaves out; its bytes are those of test_vectors.py."""

from __future__ import annotations

import msgpack
import pytest
from pydantic import ValidationError

from tests.support.node_states import report
from zenoh_vision.errors import PayloadError
from zenoh_vision.message_codec import MAX_MESSAGE_BYTES, unpack
from zenoh_vision.messages import Diagnostics, Header, Parameter, Track, Tracks

HEADER = Header(camera="front", epoch=1, seq=2, stamp_ns=300, width=640, height=480)

HEADER_BYTES = HEADER.to_bytes()


def test_a_header_leaves_out_what_does_not_apply():
    optional = {"encoding", "received_ns", "done_ns", "assumed"}
    optional |= {"replay", "replayed_ns", "lockstep", "origin", "rotated", "mirrored"}
    assert set(Header.model_fields) - set(HEADER.to_map()) == optional
    whole = HEADER.model_copy(
        update={"encoding": "bgr8", "received_ns": 0, "done_ns": 0, "assumed": False}
        | {"replay": 0, "replayed_ns": 0, "lockstep": False, "origin": "front"}
        | {"rotated": 90, "mirrored": False}
    )
    assert set(whole.to_map()) == set(Header.model_fields)


@pytest.mark.parametrize("length", range(len(HEADER_BYTES)))
def test_a_header_cut_off_at_any_byte_is_refused(length: int):
    with pytest.raises(PayloadError) as caught:
        Header.from_bytes(HEADER_BYTES[:length])
    assert caught.value.reason == "bad_header"


def test_a_message_cut_off_at_any_byte_is_refused():
    whole = Tracks(header=HEADER, tracks=()).to_bytes()
    for length in range(len(whole)):
        with pytest.raises(PayloadError, match=r"^bad_message: not msgpack"):
            Tracks.from_bytes(whole[:length])


@pytest.mark.parametrize("more", [b"\0", b"\xc0", HEADER_BYTES], ids=["0", "nil", "another"])
def test_bytes_behind_a_message_are_refused(more: bytes):
    with pytest.raises(PayloadError, match="extra data"):
        Header.from_bytes(HEADER_BYTES + more)


@pytest.mark.parametrize("name", ["camera", "epoch", "seq", "stamp_ns", "width", "height"])
def test_a_header_without_a_required_field_is_refused(name: str):
    fields = HEADER.to_map()
    del fields[name]
    with pytest.raises(PayloadError, match=rf"Header\.{name}: Field required"):
        Header.from_bytes(msgpack.packb(fields))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        pytest.param(name, value, id=f"{name}={value!r}")
        for name, values in {
            "camera": (None, 1, True, b"front", "", "Front", "a/b", "a*", "@a", "front\n"),
            "epoch": (None, True, "1", 1.0, float("nan"), 2**63, -(2**63) - 1),
            "seq": (None, False, "1", 1.0, float("inf"), -1, 2**64),
            "stamp_ns": (None, True, "1", 1.5, 2**63),
            "width": (None, True, "640", 640.0, 0, -1, 65536),
            "height": (None, True, "480", 480.0, 0, -1, 65536),
            "encoding": (1, True, ("bgr8",), "e" * 33),
            "node": (None, 1, "n" * 129),
            "revision": (None, True, "0", 0.0, -1),
            "received_ns": (True, "0", 0.5),
            "done_ns": (False, "0", 0.5),
            "assumed": (1, 0, "true"),
        }.items()
        for value in values
    ],
)
def test_a_header_with_a_field_of_wrong_type_or_range_is_refused(name: str, value: object):
    with pytest.raises(PayloadError) as caught:
        Header.from_map({**HEADER.to_map(), name: value})
    assert caught.value.detail.startswith(f"Header.{name}: ")


@pytest.mark.parametrize("value", [True, 1, 1.0, "1", None], ids=repr)
def test_a_parameter_keeps_the_type_of_its_value(value: object):
    parameter = Parameter.from_map(
        {"node": "n", "name": "p", "type": "t", "value": value, "default": None}
    )
    back = Parameter.from_bytes(parameter.to_bytes())
    assert (type(back.value), back.value) == (type(value), value)


def test_a_message_over_a_megabyte_is_refused_unread():
    diagnostics = report(message="")
    room = MAX_MESSAGE_BYTES - len(diagnostics.to_bytes()) - 4  # 0xdb and 32 bits for 0xa0
    fits = diagnostics.model_copy(update={"message": "m" * room}).to_bytes()
    assert len(fits) == MAX_MESSAGE_BYTES
    assert Diagnostics.from_bytes(fits).message == "m" * room
    with pytest.raises(PayloadError, match="1048577 bytes, at most 1048576"):
        unpack(fits + b"\0")


@pytest.mark.parametrize("depth", [1, 100, 900, 1000, 1023, 1024, 2000, 100_000])
@pytest.mark.parametrize(
    ("opening", "closing"), [(b"\x91", b"\xc0"), (b"\x81\xa1a", b"\xc0")], ids=["arrays", "maps"]
)
def test_deep_nesting_is_refused_and_nothing_worse(depth: int, opening: bytes, closing: bytes):
    nested = b"\x81\xa6camera" + opening * depth + closing
    for message, reason in ((Header, "bad_header"), (Diagnostics, "bad_message")):
        with pytest.raises(PayloadError) as caught:
            message.from_bytes(nested)
        assert caught.value.reason == reason
        assert len(caught.value.detail) < 300


def test_a_complaint_is_short_however_long_the_input():
    with pytest.raises(PayloadError) as caught:
        Header.from_map({**HEADER.to_map(), "camera": "A" * 900_000})
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("length", [2**20, 2**31, 2**32 - 1], ids=str)
@pytest.mark.parametrize("kind", [0xC6, 0xC9, 0xDB, 0xDD, 0xDF], ids=hex)
def test_a_length_that_promises_gigabytes_costs_nothing(kind: int, length: int):
    with pytest.raises(PayloadError, match="not msgpack"):
        unpack(bytes([kind]) + length.to_bytes(4) + b"\0")


def test_messages_cannot_be_changed():
    with pytest.raises(ValueError, match="frozen"):
        HEADER.seq = 3


def test_bytes_that_are_no_msgpack_are_called_so_even_if_msgpack_has_no_words_for_it():
    with pytest.raises(PayloadError, match="not msgpack: FormatError"):
        unpack(b"\xc1")  # the one byte that the specification leaves unused


def test_lists_are_taken_where_tuples_are_and_their_numbers_are_checked_as_ever():
    track = Track(id=1, state="confirmed", x=5, y=5, box=[4, 4, 2, 2], area=4, world=[1.0, 2.0])
    assert (track.box, track.world) == ((4, 4, 2, 2), (1.0, 2.0))
    with pytest.raises(ValidationError):
        track.model_validate(track.to_map() | {"box": [4, 4, 2, "2"]})
    with pytest.raises(ValidationError):
        track.model_validate(track.to_map() | {"box": "4422"})
