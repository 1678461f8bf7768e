"""``zv snapshot``: save the newest picture of a key to a file, and print its identity."""

from __future__ import annotations

import sys

import zenoh

from zenoh_vision.error_text import joined
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, PayloadError
from zenoh_vision.host.files import write_file
from zenoh_vision.image.picture import PixelPicture
from zenoh_vision.keys import JPEG, PNG
from zenoh_vision.messages import Centroid, Tracks
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.subscriber import sample_of
from zv.tools.shared.discovery import MOST_SHOWN, discover
from zv.tools.shared.drawing import draw
from zv.tools.shared.output import Output
from zv.tools.shared.session import ToolSession, key_expression
from zv.tools.snapshot.joining import join
from zv.tools.snapshot.options import STDOUT, SnapshotOptions
from zv.tools.snapshot.picture import Picture, checked, form_of

ANSWER_S = 2.0
PATIENCE_S = 5.0
UNLISTED_S = 1.0
"""How long to wait for a sample on a key of which no publisher is listed: some put without one."""


def run(options: SnapshotOptions, connection: Connection, output: Output) -> None:
    """Save the newest picture of a key.

    Raises:
        ConfigurationError: The key carries no pictures, or several keys match.
        ExpectationNotMet: There is no picture, it is too old, or it is damaged.
        SourceError: The file cannot be written.
    """
    if options.output == STDOUT and output.as_json:
        raise ConfigurationError("-o - and --json both use standard output: give one of them")
    key = key_expression(options.key)
    with ToolSession(connection) as session:
        result: Centroid | Tracks | None = None
        picture: Picture | None
        if options.draw:
            picture, result = join(session, key, connection.timeout_s or PATIENCE_S)
        else:
            picture = _newest(session, key, connection.timeout_s or PATIENCE_S)
        if picture is None:
            return
    if result is None:
        file = picture.file(options.output, options.quality)
    else:
        file = _drawn(picture, result, options)
    if options.max_age is not None and (picture.age_s is None or picture.age_s > options.max_age):
        raise ExpectationNotMet(f"{picture.text()}, allowed {options.max_age * 1e3:g} ms")
    _write(options.output, file)
    drawn = None if result is None else type(result).__name__.lower()
    if output.as_json:
        about = {"file": options.output, "bytes": len(file), "drawn": drawn}
        output.record(picture.record() | about)
    else:
        with_it = f", with its {drawn}" if drawn else ""
        output.note(f"{picture.text()}{with_it}; {len(file)} bytes to {options.output}")


def _newest(session: ToolSession, key: str, patience_s: float) -> Picture | None:
    """Return the newest picture of a key by query, else the next that arrives; None if stopped."""
    replies = session.ask(key, timeout_s=ANSWER_S)
    samples = [reply.ok for reply in replies if reply.ok is not None]
    keys = sorted({str(sample.key_expr) for sample in samples})
    if len(keys) > 1:
        raise _several(key, keys)
    if not samples and not session.stopping:  # its publisher answers no queries, or not this one
        refusals = [reply.err.payload.to_bytes() for reply in replies if reply.err is not None]
        try:
            samples = _next(session, key, patience_s)
        except ExpectationNotMet:
            if not refusals:
                raise
            reason = refusals[0].decode(errors="replace")
            raise ExpectationNotMet(f"{key}: {reason}") from None
    if session.stopping:
        return None
    try:
        pictures = [checked(sample_of(sample)) for sample in samples]
    except PayloadError as error:
        raise ExpectationNotMet(f"{key}: {error}") from None
    return max(pictures, key=lambda picture: picture.header.stamp_ns if picture.header else 0)


def _next(session: ToolSession, pattern: str, patience_s: float) -> list[zenoh.Sample]:
    """Return the next sample on the key that a key expression matches; none only if stopped.

    Raises:
        ConfigurationError: It matches several keys.
        ExpectationNotMet: None arrived in time, or it has wildcards and matches no key.
    """
    found = discover(session)
    keys = sorted(found.keys(pattern))
    if len(keys) > 1:
        raise _several(pattern, keys)
    arrived: list[zenoh.Sample] = []

    def take(sample: zenoh.Sample) -> None:
        if not arrived and sample.kind == zenoh.SampleKind.PUT:
            arrived.append(sample)

    if keys or "*" not in pattern:
        session.subscribe(keys[0] if keys else pattern, take)
        session.wait(patience_s if keys else UNLISTED_S, lambda: arrived)
    if not arrived and not session.stopping:
        raise ExpectationNotMet(found.nothing_on(pattern, pictures=True))
    return arrived


def _several(pattern: str, keys: list[str]) -> ConfigurationError:
    shown = joined(keys, MOST_SHOWN)
    return ConfigurationError(f"{pattern} matches {len(keys)} keys, name one: {shown}")


def _drawn(picture: Picture, result: Centroid | Tracks, options: SnapshotOptions) -> bytes:
    """Return a picture with its detections drawn, as a file with 8 bits per channel."""
    try:
        drawn = PixelPicture(draw(picture.frame.bgr, result))
    except PayloadError as error:
        raise ExpectationNotMet(f"{picture.sample.key}: {error}") from None
    form = form_of(options.output, default=JPEG if picture.form.encoding == JPEG else PNG)
    return drawn.jpeg(options.quality) if form == JPEG else drawn.png()


def _write(name: str, file: bytes) -> None:
    if name == STDOUT:
        sys.stdout.buffer.write(file)
        sys.stdout.buffer.flush()
        return
    write_file(name, file)
