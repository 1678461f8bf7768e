"""Which keys the expressions of other programs match."""

import pytest
import zenoh

from zenoh_vision.transport import matching
from zenoh_vision.transport.matching import MAX_TESTS, SessionIndex, matches

KEYS = sorted(
    ["v/front/image", "v/front/image/compressed", "v/image", "v/rear/image", "w/front/image"]
)


@pytest.mark.parametrize(
    ("expression", "matched"),
    [
        ("v/*/image", ["v/front/image", "v/rear/image"]),
        ("v/**/image", ["v/front/image", "v/image", "v/rear/image"]),
        ("v/front/**", ["v/front/image", "v/front/image/compressed"]),
        ("*/front/im$*", ["v/front/image", "w/front/image"]),
        ("v/*", ["v/image"]),
        ("x/**", []),
    ],
)
def test_expressions_match_as_zenoh_says(expression, matched):
    assert matches([expression], KEYS) == {expression: matched}


def test_no_key_of_administration_is_matched_by_wildcards():
    assert matches(["**"], ["@v/node/x", *KEYS]) == {"**": KEYS}


@pytest.mark.parametrize("text", ["v//*", "v/*/", "/v/*", "v/**a", "v/#*", "v/" + "a" * 200 + "/*"])
def test_what_is_no_expression_is_left_out(text):
    assert matches([text], KEYS) == {}


def count_comparisons(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the list of keys that will be made into Zenoh's, each for one comparison."""
    made: list[str] = []

    class Counting:
        ZError = zenoh.ZError

        class KeyExpr:
            autocanonize = zenoh.KeyExpr.autocanonize

            def __new__(cls, key: str) -> zenoh.KeyExpr:
                made.append(key)
                return zenoh.KeyExpr(key)

    monkeypatch.setattr(matching, "zenoh", Counting)
    return made


def test_the_work_is_bounded_whatever_nodes_subscribe_to(monkeypatch):
    keys = [f"v/c{number:04}/image" for number in range(2000)]
    made = count_comparisons(monkeypatch)
    deep = "/".join(["**/a"] * 12) + "/**"  # with keys of 60 chunks even four take 0.3 s each
    assert matches([deep, "v/" + "$*a" * 9], keys) == {}
    assert not made
    found = matches([f"v/*/x{number}" for number in range(1000)], keys)
    assert len(found) == MAX_TESTS // len(keys)
    assert len(made) <= MAX_TESTS


def test_a_key_without_wildcards_and_one_of_another_camera_cost_no_comparison(monkeypatch):
    made = count_comparisons(monkeypatch)
    assert matches(["v/image", "v/front/*"], KEYS) == {"v/front/*": ["v/front/image"]}
    assert made == ["v/front/image", "v/front/image/compressed"]


def test_the_sessions_of_a_key_are_those_of_it_and_of_expressions_that_match_it():
    sessions = {"v/front/image": {"a"}, "v/*/image": {"b", "a"}, "v/**": {"c"}, "w/*": {"d"}}
    index = SessionIndex({key: frozenset(ids) for key, ids in sessions.items()})
    assert index.matching("v/front/image") == {"a", "b", "c"}
    assert index.matching("v//no key") == set()


def test_no_session_is_found_by_an_expression_that_takes_long_to_match():
    deep = "/".join(["**/a"] * 12) + "/**"
    assert SessionIndex({deep: frozenset("a")}).matching("/".join("a" * 60)) == set()
