"""What a page may ask, and how often."""

from __future__ import annotations

import json

import pytest

from zv.viewer.websocket.commands import (
    MAX_RATE_HZ,
    MAX_SHOWN_HZ,
    CommandReader,
    MalformedCommand,
    PolicyViolation,
    SetParameters,
    Watch,
    parse_command,
)

SHOWN = json.dumps({"op": "shown", "key": "vision/front/image/compressed"})


def allowed(commands: CommandReader, text: str, now_s: float) -> bool:
    try:
        commands.read(text, now_s)
    except MalformedCommand:
        return True
    except PolicyViolation:
        return False
    return True


@pytest.mark.parametrize(
    "text",
    [
        '{"op":"unwatch","key":"a"}',
        '{"op":"unwatch","key":"shown"}',
        '{"op":"unwatch","key":"a","note":"shown"}',
        '{"op":"shown"}',  # no key
        '"shown"',
        "{",
    ],
)
def test_at_most_50_a_second_whatever_words_are_in_them(text: str):
    commands = CommandReader()
    assert [allowed(commands, text, 7.0) for _ in range(MAX_RATE_HZ + 1)] == [
        *[True] * MAX_RATE_HZ,
        False,
    ]
    assert allowed(commands, text, 8.5)


def test_that_a_picture_is_shown_may_be_said_more_often_and_counts_for_nothing_else():
    commands = CommandReader()
    assert all(allowed(commands, SHOWN, 7.0) for _ in range(MAX_SHOWN_HZ))
    assert allowed(commands, "{", 7.0)
    with pytest.raises(PolicyViolation, match=f"at most {MAX_SHOWN_HZ} such messages a second"):
        commands.read(SHOWN, 7.0)


def test_a_watch_without_size_wants_the_original():
    watch = parse_command('{"op":"watch","key":"vision/front/image/compressed"}')
    assert isinstance(watch, Watch)
    assert watch.options.unchanged("image/jpeg", 640, 480)
    small = parse_command('{"op":"watch","key":"k","width":320,"height":320}')
    assert isinstance(small, Watch)
    assert small.options.size(640, 480) == (320, 240)


def test_values_keep_their_types():
    asked = parse_command('{"op":"set","id":1,"node":"edge_front","values":{"low":5,"l2":true}}')
    assert isinstance(asked, SetParameters)
    assert asked.values == {"low": 5, "l2": True}
    assert type(asked.values["low"]) is int


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "[]", "5", "null", '{"op":"no"}', '{"op":"watch"}', '{"op":"watch","key":5}',
        '{"op":"watch","key":"k","width":0}', '{"op":"watch","key":"k","width":"3"}',
        '{"op":"watch","key":"k","quality":101}', '{"op":"set","id":1,"node":"a/b","values":{}}',
        '{"op":"set","id":1,"node":"edge","values":{}}', "[" * 5000,
        '{"op":"set","id":1,"node":"edge","values":{"a":[1]}}',
        '{"op":"set","id":-1,"node":"edge","values":{"a":1}}',
        '{"op":"set","id":1,"node":"edge","values":{"a":NaN}}',
        '{"op":"shown"}', '{"op":"unwatch","key":""}',
    ],
)  # fmt: skip
def test_a_request_that_makes_no_sense_is_refused_in_a_line(text):
    with pytest.raises(MalformedCommand) as refused:
        parse_command(text)
    assert 0 < len(str(refused.value)) < 300
