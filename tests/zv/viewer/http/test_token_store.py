"""The token that browsers must know, and where it is kept."""

import stat
from pathlib import Path

import pytest

from zv.viewer.http.token_store import token_of
from zv.viewer.settings import ViewerSettings

TOKEN = "0123456789abcdef-secret"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's state folder."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path / "zenoh-vision"


def token_for(host: str, token: str | None = None, names: str = "") -> str | None:
    return token_of(ViewerSettings(host=host, token=token, allow_host=names))


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1", "127.1.2.3"])
def test_loopback_needs_no_token_unless_one_is_set(folder: Path, host: str):
    assert token_for(host) is None
    assert token_for(host, TOKEN) == TOKEN
    assert not folder.exists()


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("name", ["cam.example", "192.0.2.7", "robot"])
def test_a_name_behind_a_proxy_needs_a_token_on_loopback_too(name: str):
    assert token_for("127.0.0.1", names=f"localhost,{name}") is not None
    assert token_for("127.0.0.1", names="localhost,127.0.0.1") is None


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.7", "robot.example", "10.0.0.1"])
def test_elsewhere_one_is_made_and_kept_for_this_user_alone(folder: Path, host: str):
    first = token_for(host)
    (kept,) = folder.iterdir()
    assert first is not None
    assert len(first) >= 32
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600
    kept.chmod(0o644)
    assert token_for(host) == first
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600


@pytest.mark.parametrize("text", ["", "short", "with a space in its middle", "\x00" * 40])
def test_a_file_without_a_token_gets_a_new_one(folder: Path, text: str):
    folder.mkdir()
    (folder / "viewer_token").write_text(text)
    made = token_for("0.0.0.0")
    assert made is not None
    assert (folder / "viewer_token").read_text().strip() == made != text


def test_where_nothing_can_be_written_it_holds_for_one_run(folder: Path, caplog):
    folder.touch()  # a file, where a folder should be
    first = token_for("0.0.0.0")
    assert first != token_for("0.0.0.0")
    assert "for this run only" in caplog.text
