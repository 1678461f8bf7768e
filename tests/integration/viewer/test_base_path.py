"""The viewer below a path of a proxy, which removes that path or does not."""

from __future__ import annotations

import re

from tests.integration.conftest import Service
from tests.support.routing import free_port
from tests.support.viewer.client import Viewer

TOKEN = "0123456789abcdef-token"


def test_all_is_served_with_the_path_and_without_and_the_printed_address_has_it(service: Service):
    port, host = free_port(), {"Host": "cam.example"}
    address = f"http://cam.example:{port}/site/cams"
    viewer = Viewer(service("view", "--port", port, "--token", TOKEN, "--address", address))
    assert viewer.url == f"{address}/?token={TOKEN}"
    for base in ("", "/site/cams"):
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
    found = viewer.get(f"/site/cams?token={TOKEN}", **host)  # without its slash
    assert (found.status, found.headers["location"]) == (308, f"cams/?token={TOKEN}")
