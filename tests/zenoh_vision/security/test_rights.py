"""Rights as rules: what includes what, by Zenoh's own key expressions."""

from __future__ import annotations

import pytest

from zenoh_vision.security.rights import ACTIONS, DEMAND, FROM_ROUTER, TO_ROUTER, Rights

RIGHTS = Rights.of(
    [
        ("publish", ["vision/front/image"]),
        ("query", ["@vision/param/*/**", "vision/**"]),
        ("publish", ["vision/front/image", "vision/front/truth"]),
    ]
)


@pytest.mark.parametrize(
    ("action", "key", "granted"),
    [
        ("publish", "vision/front/image", "vision/front/image"),
        ("publish", "vision/front/image/compressed", None),
        ("publish", "vision/*/image", None),  # more than what is allowed
        ("query", "vision/front/image", "vision/**"),
        ("query", "vision/**", "vision/**"),
        ("query", "@vision/param/a", "@vision/param/*/**"),
        ("query", "@vision/param/a/b", "@vision/param/*/**"),
        ("query", "@vision/set/a", None),
        ("query", "**", None),
        ("announce", "vision/front/image", None),
    ],
)
def test_an_expression_must_include_the_whole_of_what_is_asked(action, key, granted):
    assert RIGHTS.granting(action, key) == granted


def test_what_is_no_key_expression_in_a_file_allows_nothing():
    edited = Rights.from_map({"announce": ["vision/front/", "vision/front"]})
    assert edited.granting("announce", "vision/front") == "vision/front"
    assert edited.granting("announce", "vision/left") is None


def test_each_key_is_kept_once_and_survives_a_file():
    assert RIGHTS.allowed["publish"] == ("vision/front/image", "vision/front/truth")
    assert Rights.from_map(RIGHTS.to_map()) == RIGHTS


@pytest.mark.parametrize("fields", [None, [], {"publish": "x"}, {"fly": ["x"]}, {"query": [1]}])
def test_what_is_no_right_in_a_file_allows_nothing(fields):
    assert Rights.from_map(fields).allowed == {}


def test_a_publisher_sends_puts_and_hears_who_subscribes():
    rules = Rights.of([("publish", ["vision/front/image"])]).rules("camera", ["vision/**"])
    assert rules == [
        {
            "id": "camera: publish", "permission": "allow", "flows": ["ingress"],
            "messages": ["put"], "key_exprs": ["vision/front/image"],
        },
        {
            "id": "camera: demand", "permission": "allow", "flows": ["egress"],
            "messages": ["declare_subscriber"], "key_exprs": ["vision/**"],
        },
    ]  # fmt: skip


def test_every_action_has_its_messages():
    assert set(ACTIONS) == TO_ROUTER.keys()
    assert FROM_ROUTER.keys() | DEMAND.keys() | {"announce"} == set(ACTIONS)
