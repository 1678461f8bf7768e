"""Which requests are allowed: hosts, origins, tokens."""

import socket
import time

import pytest
from aiohttp import web
from aiohttp.test_utils import make_mocked_request

from zv.viewer.credentials import NO_TOKEN, SESSION_S, Scope, new_session, view_token
from zv.viewer.http.access import Access, cookie_name, own_names

TOKEN = "0123456789abcdef-secret"
NAMES = own_names("127.0.0.1", ("robot.example", "door"))


def allowed(check, *given) -> bool:
    try:
        check(*given)
    except (web.HTTPForbidden, web.HTTPUnauthorized):
        return False
    return True


@pytest.mark.parametrize(
    ("host", "right"),
    [
        ("127.0.0.1:8080", True),
        ("localhost:8080", True),
        ("LOCALHOST", True),
        ("[::1]:8080", True),
        ("192.0.2.7:8080", True),  # an address cannot be made to lead elsewhere
        ("robot.example", True),
        ("robot.example.:8080", True),
        ("door:80", True),
        (socket.gethostname(), True),
        ("evil.example:8080", False),
        ("127.0.0.1.evil.example", False),
        ("localhost.evil.example", False),
        ("", False),
        (None, False),
        ("[::1", True),
    ],
)
def test_a_foreign_name_that_leads_here_is_refused(host, right):
    access = Access(TOKEN, NAMES)
    assert allowed(access.check_host, host) == right


@pytest.mark.parametrize("host", ["localhost:8080", "127.0.0.1", "127.8.8.8:80", "[::1]:8080"])
def test_without_a_token_loopback_names_are_served(host):
    assert allowed(Access(None, NAMES).check_host, host)


@pytest.mark.parametrize(
    "host",
    [socket.gethostname(), f"{socket.gethostname()}.local", "robot.example", "192.0.2.7:8080"],
)
def test_without_a_token_no_name_is_served_that_others_may_answer_for(host):
    assert not allowed(Access(None, NAMES).check_host, host)


def test_the_refusal_says_how_to_allow_the_name():
    with pytest.raises(web.HTTPForbidden) as refused:
        Access(None, NAMES).check_host("cam.example:8080")
    assert "--allow-host cam.example allows" in str(refused.value.text)


@pytest.mark.parametrize(
    ("origin", "right"),
    [
        (None, True),  # no browser
        ("http://localhost:8080", True),
        ("https://localhost:8080", True),
        ("http://localhost:9090", False),
        ("http://evil.example", False),
        ("null", False),
        ("", False),
        ("http://[", False),
        ("\udcff", False),
    ],
)
def test_a_page_of_another_site_is_refused(origin, right):
    assert allowed(Access(None, NAMES).check_origin, origin, "localhost:8080") == right


def request_with(place: str, text: str) -> web.Request:
    """Return a request that gives a text in its URL, as Bearer, or in the cookie."""
    headers = {"Host": "localhost:8080"}
    if place == "bearer":
        headers["Authorization"] = f"Bearer {text}"
    if place == "cookie":
        headers["Cookie"] = f"zv_token_8080={text}"
    return make_mocked_request("GET", f"/?token={text}" if place == "url" else "/", headers)


@pytest.mark.parametrize("place", ["url", "bearer", "cookie"])
def test_tokens_are_taken_from_url_and_bearer_alone_and_sessions_from_the_cookie_alone(place):
    access = Access(TOKEN, NAMES)
    session = new_session(Scope.CONTROL, TOKEN, time.time())
    right, other = (session, TOKEN) if place == "cookie" else (TOKEN, session)
    assert access.principal(request_with(place, right)).scope is Scope.CONTROL
    assert not allowed(access.principal, request_with(place, other))


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_wrong_token_or_session_is_refused_in_each_place(place):
    access = Access(TOKEN, NAMES)
    session = new_session(Scope.CONTROL, TOKEN, time.time())

    def given(text: str) -> tuple[list[str | None], str | None]:
        tokens = [text if each == place else None for each in range(3)]
        return tokens[:2], tokens[2]

    right = session if place == 2 else TOKEN
    assert allowed(access.check_token, *given(right))
    for wrong in (right[:-1], right + "x", "", "ä", "\udcff"):
        assert not allowed(access.check_token, *given(wrong))
    assert not allowed(access.check_token, [None] * 2, None)


@pytest.mark.parametrize(
    ("host", "name"),
    [
        ("localhost:8080", "zv_token_8080"),
        ("[::1]:8081 ", "zv_token_8081"),
        ("192.0.2.7:80", "zv_token_80"),
        ("robot.example", "zv_token"),
        ("[::1]", "zv_token"),
        ("localhost:", "zv_token"),
        ("localhost:8080; x=y", "zv_token"),
        ("localhost:123456", "zv_token"),
        (None, "zv_token"),
    ],
)
def test_each_port_has_a_cookie_of_its_own(host, name):
    assert cookie_name(host) == name


def test_the_widest_scope_of_what_is_given_counts():
    access = Access(TOKEN, NAMES)
    view, control = view_token(TOKEN), new_session(Scope.CONTROL, TOKEN, time.time())
    assert access.check_token([view, None], "wrong").scope is Scope.VIEW
    for tokens, session in (([view, None], control), ([TOKEN, view], None), ([view, TOKEN], None)):
        assert access.check_token(tokens, session).scope is Scope.CONTROL


def test_a_session_that_has_ended_is_refused_and_the_refusal_says_so():
    ended = new_session(Scope.CONTROL, TOKEN, time.time() - SESSION_S)
    with pytest.raises(web.HTTPUnauthorized) as refused:
        Access(TOKEN, NAMES).check_token([], ended)
    assert "the session has ended" in str(refused.value.text)


def test_without_a_token_nobody_is_asked_for_one_and_everybody_has_control():
    for given in (([None], None), (["whatever"], "whatever")):
        assert Access(None, NAMES).check_token(*given) == NO_TOKEN
    assert NO_TOKEN.scope is Scope.CONTROL


@pytest.mark.parametrize(
    ("path", "place"),
    [
        ("/?token={}", "./"),
        ("/?a=1&token={}&b=%26%2B&token=x", "./?a=1&b=%26%2B"),
        ("http://evil.example/?token={}", "./"),
        ("/stream_viewer?topic=/a/b&token={}", "stream_viewer?topic=/a/b"),
    ],
)
@pytest.mark.parametrize("token", [TOKEN, view_token(TOKEN)])
def test_a_pages_address_with_a_token_leads_to_the_one_without(path, place, token):
    access = Access(TOKEN, NAMES)
    request = make_mocked_request("GET", path.format(token), {"Host": "localhost:8080"})
    response = access.redirect(request)
    assert response is not None
    assert (response.status, response.headers["Location"]) == (303, place)
    cookie = response.cookies["zv_token_8080"]
    assert (cookie["path"], cookie["httponly"], bool(cookie["secure"])) == ("/", True, False)
    assert token not in cookie.value
    assert access.check_token([], cookie.value).scope == access.scope_of(token)


@pytest.mark.parametrize("path", ["/", "/?token=wrong", "/?token="])
def test_an_address_without_a_valid_token_is_not_redirected(path):
    assert Access(TOKEN, NAMES).redirect(make_mocked_request("GET", path)) is None
    assert Access(None, NAMES).redirect(make_mocked_request("GET", path)) is None


@pytest.mark.parametrize(
    ("proto", "secure"), [("https", True), ("HTTPS, http", True), ("http", False), ("", False)]
)
def test_behind_a_tls_proxy_the_cookie_is_secure(proto, secure):
    headers = {"Host": "cam.example", "X-Forwarded-Proto": proto}
    response = Access(TOKEN, NAMES).redirect(
        make_mocked_request("GET", f"/?token={TOKEN}", headers)
    )
    assert response is not None
    assert bool(response.cookies["zv_token"]["secure"]) == secure


def test_the_token_does_not_show_in_a_traceback():
    assert TOKEN not in repr(Access(TOKEN, NAMES))
