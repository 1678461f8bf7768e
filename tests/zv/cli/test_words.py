"""What a line means to completion: which argument comes next, and whose names it has."""

from __future__ import annotations

import pytest

from zv.cli.completion import typed_so_far


@pytest.mark.parametrize(
    ("typed", "kind"),
    [
        ("topic echo", "key"),
        ("topic echo --once", "key"),
        ("topic echo --field x", "key"),
        ("topic echo --field=x", "key"),
        ("topic hz a/b", "key"),
        ("topic echo a/b", ""),
        ("topic pub", "key"),
        ("topic pub a/b", ""),
        ("snapshot", "key"),
        ("node info", "node"),
        ("param get", "node"),
        ("param get camera_front", "parameter"),
        ("param get camera_front rate flip", "parameter"),
        ("param set camera_front", "parameter"),
        ("param set camera_front flip", "value"),
        ("param set camera_front flip=none", "parameter"),
        ("param set camera_front flip=none loop", "value"),
        ("param set camera_front flip none", "parameter"),
        ("param set camera_front flip none loop", "value"),
        ("param dump camera_front", ""),
        ("param load camera_front", ""),
        ("--connect X param get", "node"),
        ("param --connect X get --namespace=lab", "node"),
        ("schema", ""),
    ],
)
def test_the_next_argument_of_a_line_is_known(typed: str, kind: str):
    found = typed_so_far(typed.split())
    assert found is not None
    assert found.kind() == kind


@pytest.mark.parametrize(
    "typed", ["", "topic", "camera", "topic echo --field", "--connect", "--bogus topic echo"]
)
def test_other_lines_are_completed_by_their_commands(typed: str):
    assert typed_so_far(typed.split()) is None


def test_the_connection_is_taken_from_the_line():
    found = typed_so_far(["--connect", "X", "param", "get", "--namespace=lab", "n"])
    assert found is not None
    assert found.connection == {"--connect": "X", "--namespace": "lab"}
    assert found.arguments == ["n"]
