"""Checks of the streams: cameras and their rates, losses, consumers that are too slow."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import replace

from zenoh_vision.health.counter_change import MISSED, CounterChange, counter_change
from zenoh_vision.health.node_state import NodeState
from zenoh_vision.messages import Level
from zv.tools.doctor.finding import Finding, Verdict, or_ok
from zv.tools.doctor.observation import Observation, other_form
from zv.tools.doctor.other_cameras import OtherCamera
from zv.tools.doctor.remedies import CHEAPER, remedy_for, setting, sources_of, used_share
from zv.tools.shared.nodes import place

LOSSES = 0.01
FEW = 2
"""A single frame is not significant, although it may be more than 1 % in a few seconds."""

TOO_SLOW = 0.1
TOO_LOW = 0.9
SILENT_S = 2.0
"""Silence after which a camera that is not a node has ended, or is slow."""
LONG_SILENCE = 3
"""A camera that misses more frames than this in a row has stopped, whatever its mean rate."""


def camera_findings(seen: Observation) -> Iterator[Finding]:
    """Check whether cameras capture frames at their rate."""
    cameras = seen.cameras()
    if not cameras and not seen.others:
        yield Finding("WARN", "cameras", "there is no camera", "zv camera --source synthetic")
    names = Counter(each.name for each in cameras)
    for each in cameras:
        found = _camera(seen, each)
        about = each.description
        if names[each.name] > 1 and about is not None:  # distinguishes equal lines
            text = found.text.removeprefix(f"{each.name}: ")
            found = replace(found, text=f"{each.name} ({place(about)}): {text}")
        yield found
    for other in seen.others:
        yield _other_camera(other)
    if seen.others_left_out:
        said = f"{seen.others_left_out} more programs that are not nodes declare a camera"
        yield Finding("WARN", "cameras", f"{said}: not checked", "some may be invented")


def _camera(seen: Observation, camera: NodeState) -> Finding:
    about, report = camera.description, camera.report
    assert about is not None
    if report is None:
        return _finding("OK", camera, "has just been started")
    if report.level == Level.ERROR:
        mend = "check cable, address and permission of its source; it tries again by itself"
        return _finding("FAIL", camera, report.message, mend)
    change = camera.change
    expected_hz = about.rate_hz or seen.value(camera.name, "rate")
    if change is None:
        return _finding("OK", camera, "started too recently to be checked")
    rate_hz = change.arrived / change.span_s
    silent_s = _silent_s(camera)
    mend = "check its source; after stall_after it is opened again by itself"
    if change.arrived and expected_hz is not None and expected_hz * silent_s > LONG_SILENCE:
        return _finding("FAIL", camera, f"no picture for the last {silent_s:.1f} s", mend)
    if expected_hz is not None and expected_hz * change.span_s < FEW:
        return _finding("OK", camera, f"{expected_hz:g} Hz is too slow to be checked in this time")
    if not change.arrived:
        return _finding("FAIL", camera, f"no picture in {change.span_s:.1f} s", mend)
    if expected_hz is None:
        return _finding("OK", camera, f"{rate_hz:.1f} Hz")
    short = expected_hz * change.span_s - change.arrived
    if rate_hz < TOO_LOW * expected_hz and short > FEW:
        slow = [each for each in seen.nodes if camera.name in sources_of(each, seen)]
        shares = [used_share(each, seen) for each in slow if _is_slow(each.change)]
        configured_hz = seen.value(camera.name, "rate") or expected_hz
        factor = min([rate_hz / configured_hz, *(share for share in shares if share)])
        return _finding(
            "WARN",
            camera,
            f"{rate_hz:.1f} Hz instead of {expected_hz:g} Hz",
            "its source is slower (light, USB, network) or its machine is overloaded; lower the "
            f"rate: {setting(seen, camera.name, 'rate', factor)}",
        )
    return _finding("OK", camera, f"{rate_hz:.1f} Hz, {expected_hz:g} Hz expected")


def _other_camera(camera: OtherCamera) -> Finding:
    by = "from a program that is not a node"
    if camera.arrived == 0 and camera.span_s > SILENT_S:
        said = f"{camera.key}: nothing in {camera.span_s:.1f} s {by}"
        return Finding("WARN", "cameras", said, "it has declared a publisher: see its log")
    rate = "" if camera.rate_hz is None else f"{camera.rate_hz:.1f} Hz "
    return Finding("OK", "cameras", f"{camera.key}: {rate}{by}")


def _silent_s(camera: NodeState) -> float:
    """Return for how long its newest reports say that nothing arrived, seconds."""
    newest = camera.reports[-1]
    silent_s = 0.0
    for report in reversed(camera.reports[:-1]):
        change = counter_change(report.counters, newest.counters, newest.uptime_s - report.uptime_s)
        if change is None or change.arrived:
            break
        silent_s = change.span_s
    return silent_s


def loss_findings(seen: Observation) -> list[Finding]:
    """Find nodes that lose more than 1 % of their frames, by reason."""
    problems = []
    watched = [(each, change) for each in seen.nodes if (change := each.change)]
    for each, change in watched:
        for reason, count in change.losses.items():
            if reason == "overwritten" and change.share(reason) > TOO_SLOW:
                continue  # reported by speed_findings
            if reason == MISSED and count - _lost_before(seen, each, change.span_s) < FEW:
                continue  # the camera never sent them: its own line reports it
            how_much = _how_much(each, change, reason, count)
            if how_much is not None:
                said, remedy = f"{each.name} loses {how_much}", remedy_for(reason, each, seen)
                problems.append(Finding("WARN", "drops", said, remedy, (each.name,)))
    if not watched and any(each.report for each in seen.nodes):
        said = "losses and speed are unknown: no node has reported twice in the time observed"
        mend = "observe for longer with --for; a node that has just started or ended reports once"
        return [Finding("WARN", "drops", said, mend)]
    return or_ok(problems, "drops", "no node loses more than 1 % of its frames") if watched else []


def _lost_before(seen: Observation, node: NodeState, span_s: float) -> float:
    """Return how many frames the cameras of a node lost while the node was observed.

    The times that the reports of a camera and of the node cover differ by up to the period of the
    reports.
    """
    sending = sources_of(node, seen)
    changes = [each.change for each in seen.cameras() if each.name in sending]
    return sum(sum(each.losses.values()) / each.span_s * span_s for each in changes if each)


def _how_much(node: NodeState, change: CounterChange, reason: str, count: int) -> str | None:
    """Return a text with a node's losses for a reason, or None if they are small.

    A loss of 1 or 2 % is at most a frame in a few seconds. In this case the totals since the
    node's start decide. They are not used alone, since they include losses of the past.
    """
    assert node.report is not None
    share = change.share(reason)
    if count >= FEW and share > LOSSES:
        return f"{100 * share:.1f} % of its frames as {reason} ({count} in {change.span_s:.1f} s)"
    total = counter_change({}, node.report.counters, node.report.uptime_s)
    if total is None or total.losses[reason] < FEW or total.share(reason) <= LOSSES:
        return None
    return (
        f"{100 * total.share(reason):.1f} % of its frames as {reason} "
        f"({total.losses[reason]} since its start, the last just now)"
    )


def speed_findings(seen: Observation) -> list[Finding]:
    """Find nodes that are slower than the stream they get."""
    problems = []
    watched = [(each, change) for each in seen.nodes if (change := each.change)]
    for each, change in watched:
        about = each.description
        if about is None or not _is_slow(change):
            continue
        came_hz, used_hz = change.arrived / change.span_s, change.used / change.span_s
        on = f" on {', '.join(about.subscribes)}" if about.subscribes else " from its source"
        slower = remedy_for("overwritten", each, seen)
        cheaper = [setting(seen, each.name, name) for name in CHEAPER.get(about.service, ())]
        said = f"{each.name} uses {used_hz:.1f} of {came_hz:.1f} Hz that arrive{on}"
        remedy = "; or make its work cheaper: ".join([slower, *cheaper[:1]])
        problems.append(Finding("WARN", "speed", said, remedy, (each.name,)))
    return or_ok(problems, "speed", "no node is slower than its stream") if watched else []


def _is_slow(change: CounterChange | None) -> bool:
    """Tell whether a node overwrites so much that it is slower than its stream."""
    if change is None or not change.arrived:
        return False
    few = change.losses.get("overwritten", 0) < FEW
    return not few and change.share("overwritten") > TOO_SLOW


def health_findings(seen: Observation, explained: Collection[str]) -> list[Finding]:
    """Report the problems that nodes report themselves and that no other check has explained."""
    problems = []
    for each in seen.nodes:
        report, about = each.report, each.description
        if report is None or about is None or report.level == Level.OK:
            continue
        if about.service == "camera" and report.level == Level.ERROR:
            continue
        if report.level not in (Level.ERROR, Level.STALE) and each.name in explained:
            continue
        level: Verdict = "FAIL" if report.level == Level.ERROR else "WARN"
        remedy = _why_stale(seen, each) if report.level == Level.STALE else "see its log"
        said = f"{each.name}: {report.message}"
        problems.append(Finding(level, "health", said, remedy, (each.name,)))
    return or_ok(problems, "health", "no node reports any other problem")


def _why_stale(seen: Observation, node: NodeState) -> str:
    """Return what to do about a node that gets no frames."""
    assert node.description is not None
    subscribed, is_published = node.description.subscribes, seen.is_published
    for key in subscribed:
        twin = other_form(key)
        if is_published(key) or (twin in subscribed and is_published(twin)):
            continue
        if twin and is_published(twin):
            has_setting = (node.name, "transport") in seen.parameters
            switch = f"zv param set {shlex.quote(node.name)} transport=auto"
            remedy = switch if has_setting else "subscribe to that"
            return f"nobody publishes {key}, but someone publishes {twin}: {remedy}"
        cameras = {c for n in seen.cameras() if n.description for c in n.description.cameras}
        there = sorted(cameras | {each.camera for each in seen.others})
        which = f"cameras here: {', '.join(there)}" if there else "there is no camera"
        either = f"{key} or {twin}" if twin in subscribed else key
        return f"nobody publishes {either}, {which}; start one or choose another with --camera"
    if circle := _circle(seen, node.name):
        them = " and ".join(circle)
        return f"{them} get pictures only from each other: give one of them the KEY of a camera"
    return "its camera is running: see the lines about it"


def _circle(seen: Observation, name: str) -> list[str]:
    """Return the nodes of the circle that a node is in, if no camera sends pictures into it."""
    nodes = {each.name: each for each in seen.nodes}
    found: set[str] = set()
    waiting = [name]
    while waiting:
        new = set(sources_of(nodes[waiting.pop()], seen)) - found
        found |= new
        waiting += new
    has_camera = any(each.name in found for each in seen.cameras())
    return [] if has_camera or name not in found else sorted(found)


def _finding(level: Verdict, camera: NodeState, text: str, remedy: str = "") -> Finding:
    return Finding(level, "cameras", f"{camera.name}: {text}", remedy, (camera.name,))
