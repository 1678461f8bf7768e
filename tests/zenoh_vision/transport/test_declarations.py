"""Lists of routers' admin spaces: only those of a router's form are taken."""

from __future__ import annotations

import json
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import pytest

from zenoh_vision.transport.declarations import (
    declaration_in,
    declared_expression,
    declared_key,
    sessions_in,
)
from zenoh_vision.transport.query import Reply

ID = "0123456789abcdef0123456789abcdef"


class Payload(bytes):
    """Stands in for ``zenoh.ZBytes``."""

    def to_bytes(self) -> bytes:
        return bytes(self)


def reply(content: object, key: str = "@/ab/router/publisher/vision/front/image") -> Reply:
    sample: Any = SimpleNamespace(key_expr=key, payload=Payload(json.dumps(content).encode()))
    return Reply(sample, None, "ab", 0, 0)


def test_clients_and_peers_of_a_router_are_the_sessions_of_a_key():
    replies = [
        reply({"routers": [], "peers": ["c"], "clients": [ID, "own"]}),
        reply({"routers": [], "peers": [], "clients": ["d"]}),
        reply({"routers": [], "peers": [], "clients": ["own"]}, "@/ab/router/publisher/x"),
    ]
    assert sessions_in(replies, "own") == {"vision/front/image": {ID, "c", "d"}}


@pytest.mark.parametrize(
    "content",
    [
        {"clients": [1, "b", None], "peers": []},
        {"clients": [], "peers": "xy"},
        {"clients": {"a": 1}, "peers": []},
        {"clients": [ID + "0"], "peers": []},
        {"clients": [["a"]], "peers": []},
        {"clients": ["a"]},
        ["clients", "peers"],
        3,
    ],
)
def test_a_list_of_another_form_names_no_sessions(content):
    assert declaration_in(reply(content)) == ("vision/front/image", frozenset())


def test_what_was_declared_is_the_rest_of_the_key_of_the_reply():
    assert declared_key("queryable", "**") == "@/*/router/queryable/**"
    assert declared_expression("@/ab/router/queryable/vision/*/image") == "vision/*/image"
    assert declared_expression("@/ab/router/queryable/a/router/queryable/b") == (
        "a/router/queryable/b"
    )
    assert declared_expression("@/ab/router/queryable") == ""  # ** matches no chunk too


def test_completion_imports_no_models_for_it():
    code = "import sys, zv.tools.shared.names; print('pydantic' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "False\n"
