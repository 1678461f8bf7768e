"""Subscriptions: converts Zenoh's samples and passes them to an intake."""

from __future__ import annotations

from typing import Any

import zenoh

from zenoh_vision.errors import PayloadError
from zenoh_vision.stream.intake import Intake
from zenoh_vision.stream.sample import MAX_ATTACHMENT_BYTES, RAW_LIMIT, Sample, SizeLimit
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.session import direct

DELETE = zenoh.SampleKind.DELETE


def sample_of(sample: zenoh.Sample, limit: SizeLimit = RAW_LIMIT, key: str | None = None) -> Sample:
    """Return a copy of a sample of Zenoh's, with the current time as its time of arrival.

    Args:
        sample: As it arrived.
        limit: Of the size of its payload.
        key: Its key, if that is known.

    Raises:
        PayloadError: The limit's reason for a payload over it, or ``bad_header`` for an attachment
            that is too large. Nothing is copied then.
    """
    payload, attachment = sample.payload, sample.attachment  # each access makes an object
    limit.check(len(payload))
    if attachment is not None and len(attachment) > MAX_ATTACHMENT_BYTES:
        raise PayloadError("bad_header", f"an attachment of {len(attachment)} bytes")
    return Sample(
        key=key or str(sample.key_expr),
        payload=payload.to_bytes(),
        encoding=str(sample.encoding),
        attachment=None if attachment is None else attachment.to_bytes(),
        deleted=sample.kind == DELETE,
    )


def subscribe(
    link: Link, intake: Intake[Any, Any], key: str | None = None
) -> Declaration[zenoh.Subscriber[None]]:
    """Pass the samples on a key, by default the intake's, to the intake until ``undeclare()``."""
    expression = key or intake.key
    only_key = None if "*" in expression else expression

    def on_sample(arrived: zenoh.Sample) -> None:
        try:
            sample = sample_of(arrived, intake.limit_of(expression), only_key)
        except PayloadError as error:
            intake.reject(error)
        else:
            intake.receive(sample)

    return link.declare(lambda session: session.declare_subscriber(expression, direct(on_sample)))
