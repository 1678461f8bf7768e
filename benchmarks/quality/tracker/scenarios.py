"""The synthetic scenes that are measured, each about one difficulty."""

from __future__ import annotations

from benchmarks.quality.tracker.leaves import Leaves
from benchmarks.quality.tracker.room import Room
from benchmarks.quality.tracker.scenes import Actor, Scene, Waypoint

RED_GREY = ((60, 50, 160), (88, 84, 80))
BLUE_BLACK = ((150, 80, 40), (40, 36, 34))
WHITE_BROWN = ((215, 210, 205), (40, 60, 96))
GREEN_BEIGE = ((70, 130, 60), (140, 170, 185))
DARK = ((48, 44, 44), (62, 52, 46))


def across(begin_s: float, end_s: float, y: float, back: bool = False) -> tuple[Waypoint, ...]:
    """Return a way through the whole picture, from the left or, ``back``, from the right."""
    first, last = (-25.0, 665.0) if not back else (665.0, -25.0)
    return ((begin_s, first, y), (end_s, last, y))


def crossing() -> Scene:
    """Five meet: head-on with full occlusion, overtaking, at a right angle, three at once."""
    return Scene(
        "crossing",
        30.0,
        (
            # Head-on at nearly the same depth, at 5.5 s in the middle.
            Actor(1, (across(1.5, 9.5, 300),), colours=RED_GREY),
            Actor(2, (across(1.5, 9.5, 306, back=True),), colours=BLUE_BLACK),
            # Overtaking: the fast one starts 5 s later and passes at about 17.5 s.
            Actor(3, (across(10.0, 25.0, 250),), colours=WHITE_BROWN),
            Actor(4, (across(15.0, 20.0, 256),), colours=DARK),
            # At a right angle, with another head-on: three at once at about 24 s.
            Actor(5, (((20.0, 330.0, 600.0), (28.0, 330.0, 200.0)),), colours=GREEN_BEIGE),
            Actor(6, (across(20.0, 28.0, 410),), colours=RED_GREY),
            Actor(7, (across(20.0, 28.0, 418, back=True),), colours=BLUE_BLACK),
        ),
    )


def stopping() -> Scene:
    """One stands for 20 s, while another passes partly in front of it, then walks on."""
    stand = ((1.5, -25.0, 300.0), (4.5, 250.0, 300.0), (24.5, 250.0, 300.0), (29.0, 665.0, 300.0))
    return Scene(
        "stopping 20 s",
        30.0,
        (
            Actor(1, (stand,), colours=RED_GREY),
            Actor(2, (across(9.0, 16.0, 345, back=True),), colours=WHITE_BROWN),
            Actor(3, (across(17.0, 22.0, 460),), colours=BLUE_BLACK),
        ),
    )


def returning() -> Scene:
    """Two leave through the border and come back 3 s and 4 s later; one passes a pillar."""
    there_and_back = ((1.5, -25.0, 290.0), (5.0, 300.0, 290.0), (8.5, -25.0, 290.0))
    again = ((11.5, -25.0, 290.0), (18.5, 665.0, 290.0))
    right = ((2.0, 665.0, 365.0), (5.5, 420.0, 365.0), (9.0, 665.0, 365.0))
    right_again = ((13.0, 665.0, 365.0), (20.0, -25.0, 365.0))
    return Scene(
        "leaving, returning",
        25.0,
        (
            Actor(1, (there_and_back, again), colours=RED_GREY),
            Actor(2, (right, right_again), colours=BLUE_BLACK),
            Actor(3, (across(17.0, 24.0, 470),), colours=WHITE_BROWN),
        ),
        pillar=(480, 374, 70, 106),
    )


def shadow() -> Scene:
    """Three with shadows as long as half of them, to the sides and to the front."""
    return Scene(
        "shadow",
        20.0,
        (
            Actor(1, (across(1.5, 9.5, 220),), colours=RED_GREY, shadow=(55, 8)),
            Actor(2, (across(3.0, 11.0, 330, back=True),), colours=BLUE_BLACK, shadow=(55, 10)),
            Actor(3, (across(8.0, 18.0, 430),), colours=DARK, shadow=(-50, 12)),
        ),
    )


def light(time_s: float) -> float:
    """Return the brightness: a lamp on at 8 s, a cloud from 14 to 15 s, the lamp off at 21 s."""
    if time_s < 8:
        return 1.0
    if time_s < 14:
        return 1.35
    if time_s < 21:
        return 1.35 - 0.5 * min(time_s - 14, 1.0)
    return 0.7


def lighting() -> Scene:
    """Three in a room whose light changes at once and within a second."""
    return Scene(
        "lighting step",
        28.0,
        (
            Actor(1, (across(1.5, 11.5, 230),), colours=RED_GREY),
            Actor(2, (across(9.0, 19.0, 330, back=True),), colours=BLUE_BLACK),
            Actor(3, (across(16.0, 26.0, 440),), colours=WHITE_BROWN),
        ),
        light=light,
    )


def noise() -> Scene:
    """Three seen by a sensor with a noise of 8 grey levels."""
    return Scene(
        "camera noise",
        20.0,
        (
            Actor(1, (across(1.5, 9.5, 220),), colours=RED_GREY),
            Actor(2, (across(3.0, 11.0, 340, back=True),), colours=BLUE_BLACK),
            Actor(3, (across(8.0, 18.0, 450),), colours=WHITE_BROWN),
        ),
        noise=8.0,
    )


def leaves() -> Leaves:
    """Three pass a tree whose leaves sway in gusts, and a screen that flickers."""
    return Leaves(
        "leaves, screen",
        35.0,
        (
            Actor(1, (across(9.0, 17.0, 240),), colours=RED_GREY),
            Actor(2, (across(15.0, 23.0, 340, back=True),), colours=BLUE_BLACK),
            Actor(3, (across(22.0, 32.0, 270),), colours=WHITE_BROWN),
        ),
    )


def room() -> Room:
    """Four of the synthetic camera's scene, which cross, stand, leave and return at once."""
    return Room()


SCENARIOS = (crossing, stopping, returning, shadow, lighting, noise, leaves, room)
