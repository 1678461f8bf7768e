"""The viewer below a path of a proxy, which removes that path or does not."""

from __future__ import annotations

import re

import pytest

from tests.integration.conftest import Service
from tests.support.routing import free_port
from tests.support.viewer.client import Viewer
from tests.support.waiting import wait_until

TOKEN = "0123456789abcdef-token"


@pytest.fixture
def viewer(service: Service) -> Viewer:
    port = free_port()
    address = f"http://cam.example:{port}/site/cams"
    return Viewer(service("view", "--port", port, "--token", TOKEN, "--address", address))


@pytest.mark.parametrize("base", ["", "/site/cams"])
def test_all_is_served_with_the_path_and_without(viewer: Viewer, base: str):
    host = {"Host": "cam.example"}
    assert viewer.get(f"{base}/healthz", **host).text == "ok\n"
    redirect = viewer.get(f"{base}/?token={TOKEN}", **host)
    assert (redirect.status, redirect.headers["location"]) == (303, "./")
    page = viewer.open(f"{base}/?token={TOKEN}", **host)
    assert page.status == 200
    assert 'src="page/js/main.js"' in page.text
    assert not re.search('(href|src)="/', page.text), (
        "an address from the root is outside of the proxy's path"
    )
    cookie = redirect.headers["set-cookie"].partition(";")[0]
    assert viewer.get(f"{base}/page/js/main.js", **host, Cookie=cookie).status == 200


def test_the_path_without_its_slash_leads_to_the_page(viewer: Viewer):
    found = viewer.get(f"/site/cams?token={TOKEN}", Host="cam.example")
    assert (found.status, found.headers["location"]) == (308, f"cams/?token={TOKEN}")


def test_the_printed_address_has_the_path(viewer: Viewer):
    assert viewer.url == f"http://cam.example:{viewer.port}/site/cams/?token={TOKEN}"


def test_streams_are_listed_without_javascript(service: Service):
    viewer = Viewer(service("view", "--port", 0))
    assert '<noscript><p>Without JavaScript: <a href="streams">' in viewer.get("/").text
    service("camera", "--rate", 5)
    wait_until(lambda: "front/image/compressed" in viewer.get("/streams").text)
    page = viewer.get("/streams").text
    assert 'href="stream_viewer?topic=/vision/front/image/compressed"' in page
    assert 'src="snapshot?topic=/vision/front/image/compressed&amp;width=320"' in page
