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
STEPS = 20


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


@pytest.mark.parametrize("kind", ["session", "url", "bearer"])
async def test_the_view_token_sets_nothing_and_the_answer_names_the_scope(
    guarded: Viewer, kind: str
):
    async with guarded.page(**credentials(guarded, VIEW_TOKEN, kind)) as page:
        assert (await page.text("hello"))["scope"] == "view"
        refused = await set_parameter(page, {"sigma": 3.25})
        assert not refused["ok"]
        assert "the scope control is missing" in refused["error"]
        await page.ask("dump", id=2, node=NODE)
        assert "sigma = 1.4" in (await page.text("reply", id=2))["toml"]
    line = audit_lines(guarded, "not accepted: the scope control is missing")[0]
    assert f"(view) set parameters of {NODE}" in line
    assert "3.25" not in guarded.program.complaints


@pytest.mark.parametrize("kind", ["session", "url", "bearer"])
async def test_the_token_sets_parameters_and_the_log_has_client_name_old_and_new_value(
    guarded: Viewer, kind: str
):
    value = 50 + ["session", "url", "bearer"].index(kind)
    given = credentials(guarded, TOKEN, kind)
    who = r"token \(control\)"
    if kind == "session":
        who = rf"session {given['headers']['Cookie'].split('=')[1].split('.')[0]} \(control\)"
    async with guarded.page(**given) as page:
        assert (await page.text("hello"))["scope"] == "control"
        assert (await set_parameter(page, {"low": value}))["ok"]
    (line,) = audit_lines(guarded, f"to {value}: accepted")
    assert re.search(
        rf"INFO .*127\.0\.0\.1, {who} set low of {NODE} from \d+(\.0)? to {value}: "
        r"accepted \(revision \d+\)$",
        line,
    ), line


async def test_the_steps_of_a_slider_are_few_lines_that_end_with_the_last_value(guarded: Viewer):
    async with guarded.page(**credentials(guarded, TOKEN, "session")) as page:
        await page.text("parameters", node=NODE)
        for step in range(1, STEPS + 1):
            await page.ask("set", id=step, node=NODE, values={"high": 200 + step})
        for step in range(1, STEPS + 1):
            assert (await page.text("reply", id=step))["ok"]
    audit_lines(guarded, f"to {200 + STEPS}")
    lines = audit_lines(guarded, "set high of")
    steps = [int(found[1]) for line in lines if (found := re.search(r"in (\d+) steps", line))]
    assert sum(steps) + len(lines) - len(steps) == STEPS
    assert len(lines) < STEPS


async def test_what_a_client_wrote_stays_on_its_line(guarded: Viewer):
    forged = "\u202e\x1b[2J"
    headers = {"Authorization": f"Bearer {TOKEN}", "X-Forwarded-For": "203.0.113.9"}
    async with guarded.page(headers=headers) as page:
        values = {f"x\nINFO {forged}": f"forged\n{forged}"}
        assert not (await set_parameter(page, values))["ok"]
    (line,) = audit_lines(guarded, "forged")
    assert "127.0.0.1 for 203.0.113.9, token (control)" in line
    assert line.isprintable()


async def test_without_a_token_everybody_on_the_machine_controls_and_is_logged(
    standing_viewer: Viewer, guarded: Viewer
):
    async with standing_viewer.page() as page:
        assert (await page.text("hello"))["scope"] == "control"
        assert (await set_parameter(page, {"low": 61}))["ok"]
    assert "127.0.0.1, no token needed set low" in audit_lines(standing_viewer, "to 61")[0]
    assert standing_viewer.get("/?token=whatever").status == 200


async def test_what_was_set_just_before_the_end_is_logged_too(viewer: Viewer):
    async with viewer.page() as page:
        await page.ask("set", id=1, node="nobody", values={"low": 7})
        assert not (await page.text("reply", id=1))["ok"]
    assert viewer.program.interrupt() == 0
    said = "set low of nobody from unknown to 7: not accepted: nobody does not answer"
    assert said in viewer.program.complaints


def credentials(viewer: Viewer, token: str, kind: str) -> dict[str, Any]:
    """Return the arguments of a WebSocket that gives a token in one of the three ways."""
    if kind == "url":
        return {"params": {"token": token}}
    if kind == "bearer":
        return {"headers": {"Authorization": f"Bearer {token}"}}
    return {"headers": {"Cookie": session_of(viewer, token)}}
