"""The address that people are told to open."""

from __future__ import annotations

import errno
import socket

import pytest

from zenoh_vision.errors import ConfigurationError
from zv.viewer.http.listener import free_port, url
from zv.viewer.settings import ViewerSettings

TOKEN = "t" * 16


@pytest.mark.parametrize(
    ("host", "port", "token", "address", "expected"),
    [
        ("127.0.0.1", 8080, None, "", "http://127.0.0.1:8080/"),
        ("::1", 8080, None, "", "http://[::1]:8080/"),
        ("192.0.2.1", 80, TOKEN, "", f"http://192.0.2.1:80/?token={TOKEN}"),
        ("0.0.0.0", 8080, TOKEN, "http://127.0.0.1:8080", f"http://127.0.0.1:8080/?token={TOKEN}"),
        ("0.0.0.0", 8080, None, "https://cameras.example/", "https://cameras.example/"),
    ],
)
def test_the_address_is_where_it_listens_or_what_the_settings_say(
    host: str, port: int, token: str | None, address: str, expected: str
):
    assert url(host, port, token, address) == expected


@pytest.mark.parametrize(
    "address",
    [
        *("127.0.0.1:8080", "ftp://x/", "http://x/a?b", "http://x y/"),
        *("http://[::1", "http://[1:2]/", "http://x:70000/"),
    ],
)
def test_an_address_that_no_browser_opens_is_refused(address: str):
    with pytest.raises(ValueError, match="address"):
        ViewerSettings(address=address)


def test_a_port_that_only_root_may_serve_is_refused_with_the_way_out(
    monkeypatch: pytest.MonkeyPatch,
):
    def refuse(*_: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(socket.socket, "bind", refuse)
    with pytest.raises(ConfigurationError, match=r"allowed: 1024 or above, with --port PORT, or"):
        free_port("127.0.0.1", 80)
    with pytest.raises(ConfigurationError, match=r"allowed: 1024 or above, with port = PORT$"):
        free_port("127.0.0.1", 80, "port = PORT")
