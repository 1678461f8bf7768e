"""Whatever bytes come in, a message is read or refused with a PayloadError, nothing else."""

from __future__ import annotations

import msgpack
from hypothesis import given
from hypothesis import strategies as st

from tests.support.library import Changes, changed, changes, fuzz, tried
from zenoh_vision.messages import (
    CameraInfo,
    Centroid,
    Diagnostics,
    Header,
    NodeDescription,
    Parameter,
    ParameterList,
    Refusal,
    TrackEvent,
    Tracks,
)

MESSAGES = (
    Header,
    Centroid,
    Tracks,
    TrackEvent,
    CameraInfo,
    Diagnostics,
    Parameter,
    ParameterList,
    Refusal,
    NodeDescription,
)
HEADER = Header(camera="front", epoch=1, seq=2, stamp_ns=3, width=64, height=48, encoding="bgr8")
CENTROID = Centroid(header=HEADER, x=1, y=2, box=(0, 1, 3, 3), area=4.5)

scalars = (
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=8)
    | st.binary(max_size=8)
)
values = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=12,
)


def try_messages(payload: bytes) -> None:
    for message in MESSAGES:
        tried(message.from_bytes, payload, {"bad_header" if message is Header else "bad_message"})


@fuzz
@given(st.binary(max_size=64))
def test_messages_of_arbitrary_bytes(payload: bytes):
    try_messages(payload)


@fuzz
@given(values)
def test_messages_of_arbitrary_values(value: object):
    try_messages(msgpack.packb(value))


@fuzz
@given(st.sampled_from(sorted(Header.model_fields)), values)
def test_headers_with_an_arbitrary_field(name: str, value: object):
    payload = msgpack.packb({**HEADER.to_map(), name: value})
    tried(Header.from_bytes, payload, {"bad_header"})
    tried(Centroid.from_map, {**CENTROID.to_map(), "header": value}, {"bad_message"})


@fuzz
@given(changes)
def test_messages_with_changed_bytes(how: Changes):
    try_messages(changed(HEADER.to_bytes(), how))
    try_messages(changed(CENTROID.to_bytes(), how))
