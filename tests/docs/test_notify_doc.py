"""docs/notify.md is true: its commands run, and the event that it shows has the fields of one."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from tests.support.fork_server import ZV
from tests.support.headers import header
from tests.support.listening import open_client, wait_for_nodes
from tests.support.processes import Program
from tests.support.viewer.pages import Page
from zenoh_vision.messages import TrackEvent
from zv.notify.delivery import MOST_WAITING
from zv.notify.notice import fields_of
from zv.notify.settings import NotifySettings
from zv.notify.webhook import NOT_FOR_EVER

PAGE = Page("docs/notify.md")


@pytest.mark.parametrize("command", PAGE.commands())
def test_each_command_runs_and_ends_with_ctrl_c(command: str, empty: str, tmp_path: Path):
    words = shlex.split(command)[1:]
    with (
        Program(words, tmp_path, "notify", forked=ZV, ZV_CONNECT=empty) as program,
        open_client(empty) as session,
    ):
        wait_for_nodes(session, "notify")
        assert program.interrupt() == 0


def test_the_event_that_is_shown_has_the_fields_of_one():
    (shown,) = PAGE.blocks("json")
    fields = json.loads(shown)
    about = header(451, epoch=fields["epoch"], stamp_ns=fields["stamp_ns"])
    event = TrackEvent(header=about, event="zone_entered", id=13, zone="belt", x=285.0, y=310.0)
    made = fields_of(event.model_copy(update={"inside": 1}), fields["received_ns"])
    assert made == fields


def test_the_limits_and_options_are_those_of_the_code():
    assert f"{MOST_WAITING} events wait" in PAGE.text
    assert "except for {}, {} and {}".format(*NOT_FOR_EVER) in PAGE.text
    flags = set(re.findall(r"--([a-z][a-z-]+)", PAGE.text)) - {"connect"}
    assert {flag.replace("-", "_") for flag in flags} <= set(NotifySettings.model_fields)
