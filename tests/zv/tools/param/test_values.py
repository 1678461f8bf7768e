"""Values of parameters as text, there and back, and the commands without a network."""

from __future__ import annotations

import tomllib
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from zenoh_vision.config.constraints import limits, plain, toml_file
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.health.fleet import MAX_NODES
from zenoh_vision.messages import Parameter, ParameterList
from zenoh_vision.transport.connection import Connection
from zv.tools.param import commands
from zv.tools.param.options import SetOptions
from zv.tools.param.values import assignments, described, value_of
from zv.tools.shared.output import Output


def parameter(kind: str, default: Any = None, **fields: Any) -> Parameter:
    fields = {"value": default, **fields}
    return Parameter(node="n", name="x", type=kind, default=default, **fields)


def test_assignments_are_split_at_the_first_equals_sign():
    assert assignments(["a=1", "b=", "c=x=y"]) == {"a": "1", "b": "", "c": "x=y"}


def test_a_name_and_its_value_may_be_two_words():
    assert assignments(["a", "1"]) == {"a": "1"}
    assert assignments(["a", "x=y", "b=2", "c", ""]) == {"a": "x=y", "b": "2", "c": ""}


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["a=1", "b"], "'b' is not NAME=VALUE; allowed: such as quality=60, or quality 60"),
        (["a", "1", "a", "2"], "a is given"),
        (["a"], "'a' is not NAME=VALUE"),
        (["=1"], "'=1' is not NAME"),
        (["a=1", "a=2"], "a is given"),
    ],
)
def test_other_assignments_are_refused(texts: list[str], said: str):
    with pytest.raises(ConfigurationError, match=said):
        assignments(texts)


@pytest.mark.parametrize(
    ("kind", "default", "text", "expected"),
    [
        ("int", 5, "60", 60),
        ("int", 5, "-3", -3),
        ("int", 5, "6.0", "6.0"),
        ("int", 5, "six", "six"),
        ("int", 5, "9" * 5000, "9" * 5000),  # longer than Python reads
        ("int", None, "", None),
        ("int", None, "nil", None),
        ("int", 5, "nil", "nil"),
        ("int", 5, "", ""),
        ("float", 5.0, "6", 6.0),
        ("float", 5.0, "1e-3", 0.001),
        ("float", 5.0, "x", "x"),
        ("bool", True, "false", False),
        ("bool", False, "On", True),
        ("bool", False, "maybe", "maybe"),
        ("str", "", "60", "60"),
        ("str", "", "", ""),
        ("str", None, "", None),
        ("str", None, "nil", None),
        ("str", "", "nil", "nil"),
        ("str", "none", "none", "none"),
    ],
)
def test_a_text_means_a_value_of_the_parameters_type_or_stays_text(
    kind: str, default: Any, text: str, expected: object
):
    found = value_of(parameter(kind, default), text)
    assert (found, type(found)) == (expected, type(expected))


@pytest.mark.parametrize("value", [None, True, False, 7, -1, 0.4, 1e-05, 25.0, "", "none", "a b"])
def test_what_is_printed_can_be_typed_again(value: Any):
    kind = "str" if value is None else type(value).__name__
    default = None if value is None else value
    assert value_of(parameter(kind, default), plain(value)) == value


STRANGE = ["", "none", 'a"b\\c', "tab\tnew\nline", "\x00\x1f\x7f", "å→😀", "# no comment", "'''"]


@pytest.mark.parametrize("value", [True, 7, -(2**63), 0.1, 1e-300, 1e22, 25.0, *STRANGE])
def test_a_dumped_value_is_the_same_in_toml(value: Any):
    one = parameter(type(value).__name__, value, description="of\nthe light", unit="Hz")
    text = toml_file(ParameterList(node="n", revision=3, parameters=(one,)))
    assert tomllib.loads(text) == {"x": value}


def test_a_value_that_is_not_set_is_a_comment_in_toml():
    found = ParameterList(node="n", revision=3, parameters=(parameter("float"),))
    assert tomllib.loads(toml_file(found)) == {}
    assert "\n# x =\n" in toml_file(found)


@pytest.mark.parametrize(
    ("one", "expected"),
    [
        (parameter("int", 5, minimum=1, maximum=100_000), "1 to 100000"),
        (parameter("float", None, minimum=0.5, maximum=20), "0.5 to 20, or not set"),
        (parameter("int", 5, choices=("3", "5")), "3, 5"),
        (parameter("bool", True), "true, false"),
        (parameter("str", ""), "text"),
        (parameter("int", 5, minimum=1), "whole number from 1"),
        (parameter("float", 5.0, maximum=2.5), "number up to 2.5"),
    ],
)
def test_what_it_may_be_is_said_in_a_few_words(one: Parameter, expected: str):
    assert limits(one) == expected


def test_a_description_has_value_meaning_range_unit_and_default():
    one = parameter(
        "int", 20, value=3, minimum=0, maximum=9, unit="pixels", description="of the kernel"
    )
    assert described(one) == ["x = 3", "    of the kernel", "    int; 0 to 9; pixels; default 20"]


def test_a_note_says_how_many_nodes_that_match_are_not_set(monkeypatch, capsys):
    names = [f"a{number}" for number in range(MAX_NODES + 2)]
    tokens = [SimpleNamespace(name=name) for name in [*names, "b"]]
    session = SimpleNamespace(namespace="vision", ask_all=lambda _: [tokens])
    done: list[str] = []
    monkeypatch.setattr(commands, "ToolSession", lambda _: nullcontext(session))
    monkeypatch.setattr(commands, "_set", lambda _, node, *rest, **more: done.append(node))
    commands.set_(SetOptions(node="a*", values=("low=1",)), Connection(), Output(as_json=False))
    assert done == sorted(names)[:MAX_NODES]
    assert "2 more nodes match and are left out" in capsys.readouterr().err
