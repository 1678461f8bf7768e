"""zv doctor on frames that are lost: where, why, and what mends it."""

from __future__ import annotations

import pytest

from tests.support.diagnosing import WATCH_S, Diagnosis
from tests.support.listening import newest, open_client
from tests.support.publishing import PlainCamera


def test_frames_that_a_real_tracker_drops_are_named_by_reason(shared, start):
    start("tracker", "--namespace", "broken")
    with open_client(shared.endpoint) as session:
        camera = PlainCamera(session, key="broken/front/image/compressed")

        def send() -> None:
            camera.send()
            if camera.seq % 5 == 0:
                camera.put(b"\xff\xd8 no picture", b"\x80")

        with camera.at(25, send):
            newest(session, "broken/front/centroid")
            newest(session, "@broken/diagnostics/tracker_front")
            seen = Diagnosis(shared.endpoint, "broken", for_s=2.2)
    ((level, text, remedy),) = (line for line in seen.of("drops") if "not_an_image" in line[1])
    assert level == "WARN"
    assert text.startswith("tracker_front loses ")
    assert " % of its frames as not_an_image (" in text
    share = float(text.removeprefix("tracker_front loses ").partition(" ")[0])
    # Every sixth is none: of those in a row that were seen, a sixth, give or take one.
    count = int(text.partition("(")[2].partition(" in ")[0])
    assert share == pytest.approx(100 / 6, abs=100 / (100 * count / share) + 0.1)
    assert "zv topic info broken/front/image/compressed" in remedy


@pytest.mark.parametrize(
    ("reason", "command"),
    {
        "stale": "zv param set tracker_front max_age=0.8",
        "missed": "zv param set camera_front quality=60",
    }.items(),
    ids=["stale", "missed"],
)
def test_the_suggested_parameter_of_the_right_node_ends_a_loss(shared, stand, reason, command):
    name = reason if reason == "missed" else f"dropped.{reason}"
    key = f"{reason}/front/image/compressed"
    stand(
        "camera_front",
        namespace=reason,
        publishes=[key],
        parameters={"quality": {"value": 80, "type": "int", "minimum": 1.0, "maximum": 100.0}},
        counters=lambda s: {"captured": int(30 * s), "published": int(30 * s)},
    )
    stand(
        "tracker_front",
        namespace=reason,
        subscribes=[key],
        parameters={"max_age": {"value": 0.4, "maximum": 60.0}},
        counters=lambda s: {"received": int(30 * s), "processed": int(27 * s), name: int(3 * s)},
    )
    ((level, text, remedy),) = Diagnosis(shared.endpoint, reason, for_s=WATCH_S).of("drops")
    assert level == "WARN"
    assert f" % of its frames as {reason} (" in text
    assert remedy.endswith(command)


def test_frames_that_the_camera_itself_lost_are_not_blamed_on_the_way(shared, stand):
    key = "upstream/front/image/compressed"
    for node, about in {
        "camera_front": {
            "publishes": [key],
            "counters": lambda s: {"captured": int(30 * s), "dropped.overwritten": int(2 * s)},
        },
        "tracker_front": {
            "subscribes": [key],
            "counters": lambda s: {"received": int(28 * s), "missed": int(2 * s)},
        },
    }.items():
        stand(node, namespace="upstream", **about)
    ((_, text, _),) = Diagnosis(shared.endpoint, "upstream", for_s=WATCH_S).of("drops")
    assert text.startswith("camera_front loses 6.7 % of its frames as overwritten")


def test_a_small_loss_that_lasts_is_found_by_the_totals_and_one_that_is_over_is_not(shared, stand):
    told_s: list[float] = []

    def losing(s: float) -> dict[str, int]:
        told_s.append(s)
        one_more = s > told_s[0]
        return {"received": 2000 + int(s), "processed": 1960, "dropped.stale": 40 + one_more}

    stand("edge_front", namespace="seldom", counters=losing)
    over = {"processed": 1960, "dropped.stale": 40}
    stand(
        "tracker_front", namespace="seldom", counters=lambda s: {"received": 2000 + int(s), **over}
    )
    ((level, text, _),) = Diagnosis(shared.endpoint, "seldom", for_s=WATCH_S).of("drops")
    assert level == "WARN"
    assert text.startswith("edge_front loses 2.0 % of its frames as stale (4")
    assert "since its start" in text
