"""Checks of what flows: cameras and their rates, losses, consumers that are too slow."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from common.diagnostics import ERROR, OK, STALE
from services.figures.change import MISSED, Change, change_between
from services.tools.doctor.finding import Finding, Level
from services.tools.doctor.remedies import CHEAPER, remedy_for, setting
from services.tools.doctor.survey import Survey
from services.tools.nodes import Presence

LOSSES = 0.01
FEW = 2
"""A single frame says nothing, though it may be more than 1 % of a few seconds."""

TOO_SLOW = 0.1
TOO_LOW = 0.9


def camera_findings(survey: Survey) -> Iterator[Finding]:
    """Judge whether cameras live and have their rate."""
    cameras = survey.cameras()
    if survey.nodes and not cameras:
        yield Finding("WARN", "cameras", "there is no camera", "zv camera --source synthetic")
    for each in cameras:
        yield _camera(survey, each)


def _camera(survey: Survey, camera: Presence) -> Finding:
    about, report = camera.description, camera.report
    assert about is not None
    if report is None:
        return _finding("OK", camera, "has just been started")
    if report.level == ERROR:
        mend = "see cable, address and permission of its source; it tries again by itself"
        return _finding("FAIL", camera, report.message, mend)
    change = survey.change(camera)
    expected_hz = about.rate_hz or survey.value(camera.name, "rate")
    if change is None:
        return _finding("OK", camera, "too young to be judged")
    rate_hz = change.arrived / change.span_s
    if expected_hz is not None and expected_hz * change.span_s < FEW:
        return _finding("OK", camera, f"{expected_hz:g} Hz is too slow to be judged in this time")
    if not change.arrived:
        return _finding(
            "FAIL",
            camera,
            f"no picture in {change.span_s:.1f} s",
            "see its source; with stall_after it is opened again by itself",
        )
    if expected_hz is None:
        return _finding("OK", camera, f"{rate_hz:.1f} Hz")
    short = expected_hz * change.span_s - change.arrived
    if rate_hz < TOO_LOW * expected_hz and short > FEW:
        return _finding(
            "WARN",
            camera,
            f"{rate_hz:.1f} Hz of the {expected_hz:g} Hz it should have",
            "its source is slower (light, USB, network) or its machine is overloaded; ask for "
            f"less: {setting(survey, camera.name, 'rate', rate_hz / expected_hz)}",
        )
    return _finding("OK", camera, f"{rate_hz:.1f} Hz, {expected_hz:g} Hz expected")


def loss_findings(survey: Survey) -> Iterator[Finding]:
    """Find nodes that lose more than 1 % of their frames, by reason."""
    watched = [(each, change) for each in survey.nodes if (change := survey.change(each))]
    lossless = True
    for each, change in watched:
        for reason, count in change.losses.items():
            if reason == "overwritten" and change.share(reason) > TOO_SLOW:
                continue  # of that speed_findings tells
            if reason == MISSED and count - _lost_before(survey, each) < FEW:
                continue  # the camera never sent them: its own line tells
            how_much = _how_much(each, change, reason, count)
            if how_much is None:
                continue
            lossless = False
            yield Finding(
                "WARN",
                "drops",
                f"{each.name} loses {how_much}",
                remedy_for(reason, each, survey),
                (each.name,),
            )
    if watched and lossless:
        yield Finding("OK", "drops", "no node loses more than 1 % of its frames")


def _lost_before(survey: Survey, node: Presence) -> int:
    """Return how many frames the cameras of a node lost while they were watched."""
    assert node.description is not None
    sending = {name for key in node.description.subscribes for name in survey.publishers_of(key)}
    changes = [survey.change(each) for each in survey.cameras() if each.name in sending]
    return sum(sum(change.losses.values()) for change in changes if change)


def _how_much(node: Presence, change: Change, reason: str, count: int) -> str | None:
    """Return in words what a node loses for a reason, if that is too much.

    A loss of 1 or 2 % is a frame or none in a few seconds. Then the totals since the node's start
    judge, which alone would blame it for what is over.
    """
    assert node.report is not None
    share = change.share(reason)
    if count >= FEW and share > LOSSES:
        return f"{100 * share:.1f} % of its frames as {reason} ({count} in {change.span_s:.1f} s)"
    total = change_between({}, node.report.counters, node.report.uptime_s)
    if total is None or total.losses[reason] < FEW or total.share(reason) <= LOSSES:
        return None
    return (
        f"{100 * total.share(reason):.1f} % of its frames as {reason} "
        f"({total.losses[reason]} since its start, the last just now)"
    )


def speed_findings(survey: Survey) -> Iterator[Finding]:
    """Find nodes that are slower than the stream they get."""
    watched = [(each, change) for each in survey.nodes if (change := survey.change(each))]
    quick = True
    for each, change in watched:
        about = each.description
        count = change.losses.get("overwritten", 0)
        if about is None or count < FEW or change.share("overwritten") <= TOO_SLOW:
            continue
        quick = False
        came_hz, used_hz = change.arrived / change.span_s, change.done / change.span_s
        on = f" on {', '.join(about.subscribes)}" if about.subscribes else " from its source"
        slower = remedy_for("overwritten", each, survey, used_hz / came_hz)
        cheaper = [setting(survey, each.name, name) for name in CHEAPER.get(about.service, ())]
        yield Finding(
            "WARN",
            "speed",
            f"{each.name} uses {used_hz:.1f} of {came_hz:.1f} Hz that come{on}",
            "; or make its work cheaper: ".join([slower, *cheaper[:1]]),
            (each.name,),
        )
    if watched and quick:
        yield Finding("OK", "speed", "no node is slower than its stream")


def health_findings(survey: Survey, explained: Collection[str]) -> Iterator[Finding]:
    """Pass on what nodes complain of and no other check has explained."""
    well = True
    for each in survey.nodes:
        report, about = each.report, each.description
        if report is None or about is None or report.level == OK:
            continue
        if about.service == "camera" and report.level == ERROR:
            continue
        if report.level not in (ERROR, STALE) and each.name in explained:
            continue
        well = False
        yield Finding(
            "FAIL" if report.level == ERROR else "WARN",
            "health",
            f"{each.name}: {report.message}",
            _why_stale(survey, each) if report.level == STALE else "see its log",
            (each.name,),
        )
    if survey.nodes and well:
        yield Finding("OK", "health", "no node complains of anything else")


def _why_stale(survey: Survey, node: Presence) -> str:
    """Return what to do about a node that gets no frames."""
    assert node.description is not None
    for key in node.description.subscribes:
        if not survey.publishers_of(key):
            there = survey.camera_names()
            which = f"cameras here: {', '.join(there)}" if there else "there is no camera"
            return f"nobody publishes {key}, {which}; start it or choose with --camera"
    return "its camera is there: see the lines about it"


def _finding(level: Level, camera: Presence, text: str, remedy: str = "") -> Finding:
    return Finding(level, "cameras", f"{camera.name}: {text}", remedy, (camera.name,))
