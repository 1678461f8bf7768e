"""What each of the two tokens permits, and what the log says of changes, over the wire."""

from __future__ import annotations

import re
from typing import Any

import pytest

from tests.integration.conftest import Service
from tests.support.viewer.client import Viewer
from tests.support.waiting import wait_until
from zv.viewer.credentials import view_token

TOKEN = "0123456789abcdef-token"
VIEW_TOKEN = view_token(TOKEN)
TOPIC = "topic=/front/image/compressed"
NODE = "edge_front"


@pytest.fixture(scope="module")
def guarded(standing_service: Service) -> Viewer:
    """A viewer with a token, a camera and an edge detector."""
    viewer = Viewer(standing_service("view", "--port", 0, "--token", TOKEN))
    standing_service("camera", "--rate", 5)
    standing_service("edge")
    path = f"/snapshot?{TOPIC}&token={TOKEN}"
    wait_until(lambda: viewer.get(path).status == 200)
    return viewer


def session_of(viewer: Viewer, token: str) -> str:
    """Open the page with a token and return the cookie."""
    return viewer.get(f"/?token={token}").headers["set-cookie"].partition(";")[0]


def audit_lines(viewer: Viewer, text: str) -> list[str]:
    """Return the lines about changes that have a text in them, as soon as there is one."""

    def found() -> list[str]:
        return [line for line in viewer.program.complaints.split("\n") if text in line]

    return wait_until(found, explain=lambda: viewer.program.complaints)


async def set_parameter(page: Any, values: dict[str, object]) -> dict[str, Any]:
    await page.text("parameters", node=NODE)
    await page.ask("set", id=1, node=NODE, values=values)
    reply: dict[str, Any] = await page.text("reply", id=1)
    return reply


def test_the_view_token_opens_all_that_is_read(guarded: Viewer):
    printed = guarded.program.lines(r"view only: (http://\S+)")[0][1]
    assert printed == guarded.url.replace(TOKEN, VIEW_TOKEN)
    cookie = session_of(guarded, VIEW_TOKEN)
    assert VIEW_TOKEN not in cookie
    path = f"/snapshot?{TOPIC}"
    for answer in (
        guarded.open(f"/?token={VIEW_TOKEN}"),
        guarded.get("/", Cookie=cookie),
        guarded.get(path, Cookie=cookie),
        guarded.get(f"{path}&token={VIEW_TOKEN}", Sec_Fetch_Site="cross-site"),
        guarded.get(path, Authorization=f"Bearer {VIEW_TOKEN}"),
    ):
        assert answer.status == 200, answer.text
    with guarded.stream(f"{TOPIC}&token={VIEW_TOKEN}") as pictures:
        assert next(pictures).body
    assert guarded.get("/", Cookie=cookie[:-1]).status == 401


def test_the_page_of_one_stream_loses_the_token_too_and_its_picture_never_had_it(guarded: Viewer):
    answer = guarded.get(f"/stream_viewer?{TOPIC}&token={TOKEN}&width=320")
    assert answer.status == 303
    assert answer.headers["location"] == "stream_viewer?topic=/front/image/compressed&width=320"
    shown = guarded.open(f"/stream_viewer?{TOPIC}&token={TOKEN}&width=320")
    assert shown.status == 200
    assert 'src="stream?topic=' in shown.text
    assert "token" not in shown.text


async def test_a_session_of_the_token_sets_parameters_and_the_log_has_its_name_and_both_values(
    guarded: Viewer,
):
    session = session_of(guarded, TOKEN)
    name = session.split("=")[1].split(".")[0]
    async with guarded.page(headers={"Cookie": session}) as page:
        assert (await page.text("hello"))["scope"] == "control"
        assert (await set_parameter(page, {"low": 51}))["ok"]
    (line,) = audit_lines(guarded, "to 51: accepted")
    assert re.search(
        rf"INFO .*127\.0\.0\.1, session {name} \(control\) set low of {NODE} "
        r"from \d+(\.0)? to 51: accepted \(revision \d+\)$",
        line,
    ), line


async def test_what_was_set_just_before_the_end_is_logged_too(viewer: Viewer):
    async with viewer.page() as page:
        await page.ask("set", id=1, node="nobody", values={"low": 7})
        assert not (await page.text("reply", id=1))["ok"]
    assert viewer.program.interrupt() == 0
    said = "set low of nobody from unknown to 7: not accepted: nobody does not answer"
    assert said in viewer.program.complaints
