"""What mends a loss: the parameter for each reason, and whose it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from services.tools.doctor.survey import Survey
from services.tools.nodes import Presence

Whose = Literal["own", "camera"]


@dataclass(frozen=True, slots=True)
class Remedy:
    """How a loss is mended.

    Attributes:
        words: What to do, or to look at.
        parameter: What to change; empty if no parameter helps.
        whose: The node's own parameter, or its camera's.
        factor: The new value over the present one; 0 if no rule gives one.
    """

    words: str
    parameter: str = ""
    whose: Whose = "own"
    factor: float = 0.0


SENDER = "find who sends them: zv topic info"

REMEDIES: Final = {
    "overwritten": Remedy("more come than it can use: lower the rate", "rate", "camera", 0.8),
    "missed": Remedy(
        "lost on the way: the link is too slow for them, lower the quality",
        "quality",
        "camera",
        0.75,
    ),
    "stale": Remedy(
        "they come late: the link or the machine is too slow; allow more age", "max_age", "own", 2.0
    ),
    "repeated": Remedy(
        "the source gives each picture several times: ask no more of it than it has", "rate", "own"
    ),
    "given_up": Remedy(
        "the source stalls: see its cable or network, or be more patient", "stall_after", "own", 2.0
    ),
    "out_of_order": Remedy(
        "two publishers share a key, or a camera's clock was set: give each camera a --camera of "
        "its own"
    ),
    "bad_stamp": Remedy("the camera's clock is wrong: set it by NTP"),
    "no_header": Remedy("a second publisher without headers: " + SENDER),
    "wrong_camera": Remedy("their header names another camera than the key: " + SENDER),
    "corrupt": Remedy("the source or a foreign publisher damages them: " + SENDER),
    "not_rendered": Remedy("the viewer's log says which pictures it cannot make, and why"),
    "too_large": Remedy("make the pictures smaller: width and height", "width", "camera"),
    "unsupported_encoding": Remedy("choose one that is known", "encoding", "camera"),
    **{
        reason: Remedy("a publisher breaks the format of docs/messages.md: " + SENDER)
        for reason in ("bad_header", "wrong_size", "empty", "not_an_image", "bad_message")
    },
}
"""By the reasons of docs/messages.md; ``no_subscriber`` and ``unwatched`` are no loss."""

CHEAPER: Final = {"tracker": ("closing", "median"), "edge": ("sigma",)}
"""Parameters that cost a service the most time: smaller is cheaper."""


def remedy_for(reason: str, node: Presence, survey: Survey, factor: float | None = None) -> str:
    """Return what to do about frames that a node loses for a reason.

    Args:
        reason: As it is counted.
        node: Who loses them.
        survey: For who sends them, and the parameters' present values.
        factor: The parameter's new value over the present one, if that is known better.
    """
    remedy = REMEDIES.get(reason)
    about = node.description
    if remedy is None or about is None:
        return "docs/messages.md says what the reason means"
    words = remedy.words
    if words.endswith(SENDER) and about.subscribes:
        words = f"{words} {about.subscribes[0]}"
    target = node.name
    if remedy.whose == "camera" and about.service != "camera":
        cameras = [name for key in about.subscribes for name in survey.publishers_of(key)]
        target = cameras[0] if cameras else ""
    if not remedy.parameter or not target:
        return words
    return f"{words}: {setting(survey, target, remedy.parameter, factor or remedy.factor)}"


def setting(survey: Survey, node: str, parameter: str, factor: float = 0.0) -> str:
    """Return the command that sets a parameter, with a value if the present one is known."""
    now = survey.value(node, parameter)
    known = survey.parameters.get((node, parameter))
    value = "VALUE"
    if now is not None and factor:
        wanted = now * factor
        if known is not None and known.maximum is not None:
            wanted = min(wanted, known.maximum)
        value = f"{max(1, round(wanted))}" if isinstance(now, int) else f"{wanted:.3g}"
    return f"zv param set {node} {parameter}={value}"
