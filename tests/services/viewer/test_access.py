"""Who may ask: hosts, origins, tokens."""

import socket
import stat

import pytest

from services.viewer.access import Access, Refused, cookie_name, own_names, token_for

TOKEN = "0123456789abcdef-secret"
NAMES = own_names("127.0.0.1", "robot.example,door")


def allowed(check, *given) -> bool:
    try:
        check(*given)
    except Refused:
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
    access = Access(None, NAMES)
    assert allowed(access.check_host, host) == right


def test_the_refusal_says_how_to_allow_the_name():
    with pytest.raises(Refused, match=r"--allow-host cam\.example would") as refused:
        Access(None, NAMES).check_host("cam.example:8080")
    assert refused.value.status == 403


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


@pytest.mark.parametrize("place", ["query", "cookie", "bearer"])
def test_the_token_is_taken_from_each_place(place):
    access = Access(TOKEN, NAMES)
    assert allowed(access.check_token, {place: TOKEN})
    for wrong in (TOKEN[:-1], TOKEN + "x", "", "ä", "\udcff"):
        assert not allowed(access.check_token, {place: wrong})
    assert not allowed(access.check_token, {})


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


def test_without_a_token_nobody_is_asked_for_one():
    assert allowed(Access(None, NAMES).check_token, {"query": "whatever"})


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1", "127.1.2.3"])
def test_loopback_needs_no_token_unless_one_is_set(tmp_path, host):
    assert token_for(host, None, tmp_path) is None
    assert token_for(host, TOKEN, tmp_path) == TOKEN
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.7", "robot.example", "10.0.0.1"])
def test_elsewhere_one_is_made_and_kept_for_this_user_alone(tmp_path, host):
    first = token_for(host, None, tmp_path / "state")
    (kept,) = (tmp_path / "state").iterdir()
    assert first is not None
    assert len(first) >= 32
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600
    kept.chmod(0o644)
    assert token_for(host, None, tmp_path / "state") == first
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600


@pytest.mark.parametrize("text", ["", "short", "with a space in its middle", "\x00" * 40])
def test_a_file_without_a_token_gets_a_new_one(tmp_path, text):
    (tmp_path / "viewer_token").write_text(text)
    made = token_for("0.0.0.0", None, tmp_path)
    assert made is not None
    assert (tmp_path / "viewer_token").read_text().strip() == made != text


def test_where_nothing_can_be_written_it_holds_for_one_run(tmp_path, caplog):
    (tmp_path / "state").touch()  # a file, where a folder should be
    first = token_for("0.0.0.0", None, tmp_path / "state")
    assert first != token_for("0.0.0.0", None, tmp_path / "state")
    assert "for this run only" in caplog.text


def test_the_token_does_not_show_in_a_traceback():
    assert TOKEN not in repr(Access(TOKEN, NAMES))
