"""Subscriptions: converts Zenoh's samples and passes them to an intake."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import zenoh

from zenoh_vision.errors import PayloadError
from zenoh_vision.host.clock import SYSTEM_CLOCK, Clock
from zenoh_vision.keys import RouteName
from zenoh_vision.stream.intake import Intake
from zenoh_vision.stream.sample import MAX_ATTACHMENT_BYTES, RAW_LIMIT, Sample, SizeLimit
from zenoh_vision.transport.link import Declaration, Link
from zenoh_vision.transport.session import direct

DELETE = zenoh.SampleKind.DELETE


def sample_of(
    sample: zenoh.Sample,
    limit: SizeLimit = RAW_LIMIT,
    key: str | None = None,
    route: RouteName = "jpeg",
    clock: Clock = SYSTEM_CLOCK,
) -> Sample:
    """Return a copy of a sample of Zenoh's, with the current time as its time of arrival.

    Raises:
        PayloadError: The limit's reason for a payload over it, or ``bad_header`` for an attachment
            that is too large. Nothing is copied then.
    """
    payload, attachment = sample.payload, sample.attachment  # each access makes an object
    encoding = str(sample.encoding)
    limit.check(len(payload), encoding)
    if attachment is not None and len(attachment) > MAX_ATTACHMENT_BYTES:
        raise PayloadError("bad_header", f"an attachment of {len(attachment)} bytes")
    return Sample(
        key=key or str(sample.key_expr),
        payload=payload.to_bytes(),
        encoding=encoding,
        attachment=None if attachment is None else attachment.to_bytes(),
        arrived_ns=clock.monotonic_ns(),
        received_ns=clock.time_ns(),
        deleted=sample.kind == DELETE,
        route=route,
    )


def subscribe(
    link: Link,
    intake: Intake[Any, Any],
    key: str | None = None,
    *,
    route: RouteName = "jpeg",
    delivered: Callable[[Sample], None] | None = None,
) -> Declaration[zenoh.Subscriber[None]]:
    """Pass the samples on a key to an intake until ``undeclare()``.

    The key is by default the intake's; ``delivered`` is called with each sample that is good.
    """
    expression = key or intake.key
    only_key = None if "*" in expression else expression

    def on_sample(arrived: zenoh.Sample) -> None:
        try:
            sample = sample_of(arrived, intake.limit, only_key, route, intake.clock)
        except PayloadError as error:
            intake.reject(error)
        else:
            if intake.receive(sample) and delivered is not None:
                delivered(sample)

    return link.declare(lambda session: session.declare_subscriber(expression, direct(on_sample)))
