"""The way of a snapshot: ask or listen, put it in form, write it, say what it is."""

from __future__ import annotations

import importlib
import sys
import threading
from pathlib import Path

from common.connection import Connection
from common.errors import ConfigurationError, ExpectationNotMet, PayloadError, SourceError
from services.tools.output import Output
from services.tools.session import ToolSession, key_expression
from services.tools.snapshot.forms import encoded, encoded_pixels, frame_of, wanted_form
from services.tools.snapshot.joining import Pair, join
from services.tools.snapshot.options import STDOUT, SnapshotOptions
from services.tools.snapshot.shot import Shot, shot_of
from services.tools.survey import survey

COMPRESSED = "/compressed"
"""How keys of pictures end that can be saved as they come."""

ANSWER_S = 2.0
PATIENCE_S = 5.0


def run(options: SnapshotOptions, connection: Connection, output: Output) -> None:
    """Save the newest picture of a key.

    Raises:
        ConfigurationError: The key carries no pictures, or several keys match.
        ExpectationNotMet: There is none, it is too old, or it is broken.
        SourceError: The file cannot be written.
    """
    if options.output == STDOUT and output.as_json:
        raise ConfigurationError("-o - and --json both want standard output: give one")
    key = key_expression(options.key)
    if options.draw or not key.endswith(COMPRESSED):
        # OpenCV takes a tenth of a second to load; meanwhile the picture is on its way.
        threading.Thread(target=importlib.import_module, args=("cv2",), daemon=True).start()
    with ToolSession(connection) as session:
        if options.draw:
            pair = join(session, key, connection.timeout_s or PATIENCE_S)
            if pair is None or pair.shot is None:
                return
            shot, drawn = pair.shot, _drawn_by(pair)
            file = _with_drawing(pair, options)
        else:
            found = newest(session, key)
            if found is None:
                return
            shot, drawn = found, None
            file = encoded(shot, options.output, options.quality)
    if options.max_age is not None and (shot.age_s is None or shot.age_s > options.max_age):
        raise ExpectationNotMet(f"{shot.words()}, allowed {options.max_age * 1e3:g} ms")
    _write(options.output, file)
    about = {"file": options.output, "bytes": len(file), "drawn": drawn}
    if output.as_json:
        output.record(shot.record() | about)
    else:
        words = f", with its {drawn}" if drawn else ""
        output.note(f"{shot.words()}{words}; {len(file)} bytes to {options.output}")


def newest(session: ToolSession, key: str) -> Shot | None:
    """Return the newest picture of a key by query; None if told to stop.

    Raises:
        ConfigurationError: The key carries no pictures, or several keys match.
        ExpectationNotMet: Nobody has one.
    """
    replies = session.ask(key, timeout_s=ANSWER_S)
    samples = [reply.ok for reply in replies if reply.ok is not None]
    keys = sorted({str(sample.key_expr) for sample in samples})
    if session.stopping:
        return None
    if len(keys) > 1:
        raise ConfigurationError(f"{key} matches {len(keys)} keys, name one: {', '.join(keys)}")
    if not samples:
        refusals = [reply.err.payload.to_bytes() for reply in replies if reply.err is not None]
        if refusals:
            raise ExpectationNotMet(f"{key}: {refusals[0].decode(errors='replace')}")
        raise ExpectationNotMet(survey(session).nothing_on(key))
    shots = [shot_of(sample) for sample in samples]
    return max(shots, key=lambda shot: shot.header.stamp_ns if shot.header else 0)


def _drawn_by(pair: Pair) -> str:
    return "centroid" if pair.tracks is None else "tracks"


def _with_drawing(pair: Pair, options: SnapshotOptions) -> bytes:
    """Return the picture with what was found in it, 8 bits a channel.

    Raises:
        ExpectationNotMet: It cannot be decoded.
    """
    from services.tools.snapshot.drawing import draw_centroid, draw_tracks

    assert pair.shot is not None
    try:
        bgr = frame_of(pair.shot).bgr
    except PayloadError as error:
        raise ExpectationNotMet(f"{pair.shot.key}: {error}") from None
    if pair.tracks is not None:
        bgr = draw_tracks(bgr, pair.tracks)
    elif pair.centroid is not None:
        bgr = draw_centroid(bgr, pair.centroid)
    form = wanted_form(pair.shot, STDOUT)
    return encoded_pixels(bgr, options.output, options.quality, form)


def _write(name: str, file: bytes) -> None:
    if name == STDOUT:
        sys.stdout.buffer.write(file)
        sys.stdout.buffer.flush()
        return
    try:
        Path(name).write_bytes(file)
    except (OSError, ValueError) as error:
        raise SourceError(f"{name}: {getattr(error, 'strerror', None) or error}") from None
