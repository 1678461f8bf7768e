"""What each of the two tokens permits, over the wire."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from tests.integration.conftest import Service
from tests.support.viewer_client import Viewer
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
    assert answer.headers["location"] == "/stream_viewer?topic=/front/image/compressed&width=320"
    shown = guarded.open(f"/stream_viewer?{TOPIC}&token={TOKEN}&width=320")
    assert shown.status == 200
    assert 'src="stream?topic=' in shown.text
    assert "token" not in shown.text


@pytest.mark.parametrize("kind", ["session", "url", "bearer"])
def test_the_view_token_sets_nothing_and_the_answer_names_the_scope(guarded: Viewer, kind: str):
    async def test() -> None:
        async with guarded.page(**credentials(guarded, VIEW_TOKEN, kind)) as page:
            assert (await page.text("hello"))["scope"] == "view"
            refused = await set_parameter(page, {"sigma": 3.25})
            assert not refused["ok"]
            assert "the scope control is missing" in refused["error"]
            await page.ask("dump", id=2, node=NODE)
            assert "sigma = 1.4" in (await page.text("reply", id=2))["toml"]

    asyncio.run(test())


@pytest.mark.parametrize("kind", ["session", "url", "bearer"])
def test_the_token_sets_parameters(guarded: Viewer, kind: str):
    async def test() -> None:
        async with guarded.page(**credentials(guarded, TOKEN, kind)) as page:
            assert (await page.text("hello"))["scope"] == "control"
            assert (await set_parameter(page, {"low": 50}))["ok"]

    asyncio.run(test())


def test_without_a_token_everybody_on_the_machine_controls(
    standing_viewer: Viewer, guarded: Viewer
):
    async def test() -> None:
        async with standing_viewer.page() as page:
            assert (await page.text("hello"))["scope"] == "control"
            assert (await set_parameter(page, {"low": 61}))["ok"]

    asyncio.run(test())
    assert standing_viewer.get("/?token=whatever").status == 200


def credentials(viewer: Viewer, token: str, kind: str) -> dict[str, Any]:
    """Return the arguments of a WebSocket that gives a token in one of the three ways."""
    if kind == "url":
        return {"params": {"token": token}}
    if kind == "bearer":
        return {"headers": {"Authorization": f"Bearer {token}"}}
    return {"headers": {"Cookie": session_of(viewer, token)}}
