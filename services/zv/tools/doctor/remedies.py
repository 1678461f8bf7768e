"""Remedies for losses: what to do for each reason, and which parameter to change."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from dataclasses import dataclass
from typing import Final

from zenoh_vision.error_text import joined
from zenoh_vision.health.counter_change import MISSED
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.keys import suffix_of
from zenoh_vision.messages import Level
from zenoh_vision.topics import RAW
from zv.tools.doctor.observation import Observation, other_form


@dataclass(frozen=True, slots=True)
class Remedy:
    """The remedy for a loss.

    Attributes:
        words: What to do or to check.
        parameter: The parameter to change; empty if no parameter helps.
        factor: Ratio of the new value to the current one; 0 if there is no rule for it.
        of_camera: Whether it is a parameter of the camera instead of the node itself.
    """

    words: str
    parameter: str = ""
    factor: float = 0.0
    of_camera: bool = False


MAX_SENDERS = 3
SENDER = "find who sends them: zv topic info"

REMEDIES: Final = {
    "overwritten": Remedy(
        "more frames arrive than it can process: lower the rate", "rate", 0.9, of_camera=True
    ),
    "missed": Remedy(
        "frames are lost in the network: the link is too slow, lower the quality",
        "quality",
        0.75,
        True,
    ),
    "stale": Remedy(
        "frames arrive late: the link or the machine is too slow; allow more age", "max_age", 2.0
    ),
    "repeated": Remedy(
        "the source repeats its picture, and skip_repeats leaves repeats out: set it to false",
        "skip_repeats",
    ),
    "lagging": Remedy(
        "pictures of the source waited too long and were skipped: decoding or the network is too "
        "slow; use a smaller stream, a lower rate or hwaccel, or allow more lag",
        "max_lag",
        2.0,
    ),
    "at_source": Remedy(
        "the device took pictures that were not read in time, or sent damaged ones: check its "
        "cable or network (packets_lost), or give the camera more processor time"
    ),
    "live": Remedy(
        "a node publishes on keys of the recording: stop it, or play under other names with --as "
        "or --namespace"
    ),
    "given_up": Remedy(
        "the source stalls: check its cable or network, or wait longer", "stall_after", 2.0
    ),
    "over_budget": Remedy(
        "max_kbps is too low for its rate: allow more, or lower the rate", "max_kbps", 1.5
    ),
    "region_outside": Remedy("the region is not in the frame: set another", "region"),
    "bad_calibration": Remedy("make the camera's file again with zv calibrate"),
    "out_of_order": Remedy(
        "two publishers share a key, or a camera's clock was set: give each camera a --camera of "
        "its own"
    ),
    "overflow": Remedy(
        "more frames arrive than it can process: lower the rate", "rate", 0.9, of_camera=True
    ),
    "unpaired": Remedy(
        "one of its two cameras is silent, slower, or has another clock: compare their rates and "
        "stamps"
    ),
    "not_kept": Remedy("its disk takes no more events: its health and its log have the reason"),
    "too_many_keys": Remedy("its wildcard matches too many keys: name the cameras to follow"),
    "unknown_message": Remedy("their encoding names no known message: " + SENDER),
    "bad_stamp": Remedy("the camera's clock is wrong: set it by NTP"),
    "no_header": Remedy(
        "a second publisher sends no headers, or a camera's name has other characters than a-z, "
        "0-9 and _: " + SENDER
    ),
    "wrong_camera": Remedy("their header names another camera than the key: " + SENDER),
    "corrupt": Remedy("the source or another publisher damages them: " + SENDER),
    "failed": Remedy("see the log of the camera for the error, and report it"),
    "not_rendered": Remedy("see the viewer's log for the pictures that it cannot convert, and why"),
    "too_large": Remedy(
        "its max_pixels is lower than the pictures, of its camera or of another publisher (zv "
        "topic info): start it with a higher one, or make them smaller, with width and height",
        "width",
        of_camera=True,
    ),
    "unsupported_encoding": Remedy("choose a supported encoding", "encoding", of_camera=True),
    **{
        reason: Remedy("a publisher violates the format of such messages: " + SENDER)
        for reason in ("bad_header", "wrong_size", "empty", "not_an_image", "bad_message")
    },
}
"""Remedies by reason, except for the reasons that are not losses."""

CHEAPER: Final = {"tracker": ("closing", "median"), "edge": ("sigma",)}
"""Parameters that cost a service the most time: smaller is cheaper."""


def remedy_for(reason: str, node: NodeState, seen: Observation) -> str:
    """Return what to do about frames that a node loses for a reason."""
    about, report = node.description, node.report
    if reason == MISSED and report is not None and set((report.routes or {}).values()) == {"shm"}:
        reason = "overwritten"  # only the newest frame waits in shared memory
    remedy = REMEDIES.get(reason)
    if remedy is None or about is None:
        return "see the log of the node"
    if reason == MISSED and about.service == "recorder" and report and report.level != Level.OK:
        return f"its health says why: {report.message}"
    if reason in ("out_of_order", "overwritten") and (name := _twins(seen, node)):
        return f"there are several {name}, see names: stop all but one"
    words = remedy.words
    if words.endswith(SENDER) and about.subscribes:
        key = next(filter(seen.is_published, about.subscribes), about.subscribes[0])
        if reason == "no_header" and suffix_of(key) == RAW.name:
            return _raw_without_header(seen, key)
        words = f"{words} {shlex.quote(key)}{_who_sends(seen, key)}"
    target, factor = node.name, remedy.factor
    if remedy.of_camera:
        target = next(iter(sources_of(node, seen)), "")
    if not remedy.parameter or not target:
        return words
    if remedy.of_camera and remedy.parameter == "rate":
        factor = min(factor, used_share(node, seen) or factor)
    return f"{words}: {setting(seen, target, remedy.parameter, factor)}"


def sources_of(node: NodeState, seen: Observation) -> list[str]:
    """Return the names of the nodes whose frames a node uses; a camera's own name."""
    about = node.description
    if about is None or about.service == "camera":
        return [node.name]
    named = (name for key in about.subscribes for name in seen.discovery.nodes_publishing(key))
    return list(dict.fromkeys(named))


def used_share(node: NodeState, seen: Observation) -> float | None:
    """Return the rate at which a node uses frames, divided by its cameras' configured rates.

    The rate of arrivals would not do: cameras may be slower than configured, and frames may be lost
    on the way. None if a rate is unknown.
    """
    rates = [seen.value(name, "rate") for name in sources_of(node, seen)]
    known = [rate_hz for rate_hz in rates if rate_hz]
    if node.change is None or not known or len(known) < len(rates):
        return None
    return node.change.used / node.change.span_s / sum(known)


def _raw_without_header(seen: Observation, key: str) -> str:
    """Return what to do about raw pixels without a header, and who publishes them if known."""
    sender = _who_sends(seen, key) if seen.strangers(key)[1] else ""
    return (
        f"the raw pixels on {key} have no header, which raw pixels need: send one, or send JPEGs "
        f"on {other_form(key)}{sender}"
    )


def _who_sends(seen: Observation, key: str) -> str:
    """Return the programs that may send the samples that a node refuses, as far as known."""
    found, sure = seen.strangers(key)
    if not found:
        return ""
    who = "besides the nodes, it is published by" if sure else "programs here that are no nodes:"
    return f"; {who} {joined(found, MAX_SENDERS)}"


def _twins(seen: Observation, node: NodeState) -> str:
    """Return the name that two publishers of a node's input share; empty if none does."""
    names = Counter(each.name for each in seen.nodes)
    return next((name for name in sources_of(node, seen) if names[name] > 1), "")


def setting(seen: Observation, node: str, parameter: str, factor: float = 0.0) -> str:
    """Return the command that sets a parameter, with a value if the current one is known."""
    now = seen.value(node, parameter)
    known = seen.parameters.get((node, parameter))
    value = "VALUE"
    if now is not None and factor and math.isfinite(now * factor):
        wanted = now * factor
        if known is not None and known.maximum is not None:
            wanted = min(wanted, known.maximum)
        value = f"{max(1, round(wanted))}" if isinstance(now, int) else f"{wanted:.3g}"
    return f"zv param set {shlex.quote(node)} {parameter}={value}"
