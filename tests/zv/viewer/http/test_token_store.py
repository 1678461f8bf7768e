"""The token that browsers must know, and where it is kept."""

import stat

import pytest

from zv.viewer.http.token_store import token_for

TOKEN = "0123456789abcdef-secret"


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1", "127.1.2.3"])
def test_loopback_needs_no_token_unless_one_is_set(tmp_path, host):
    assert token_for(host, None, tmp_path) is None
    assert token_for(host, TOKEN, tmp_path) == TOKEN
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["cam.example", "192.0.2.7", "robot"])
def test_a_name_behind_a_proxy_needs_a_token_on_loopback_too(tmp_path, name):
    assert token_for("127.0.0.1", None, tmp_path, names=["localhost", name]) is not None
    assert token_for("127.0.0.1", None, tmp_path, names=["localhost", "127.0.0.1"]) is None


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
