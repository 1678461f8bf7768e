"""A program of one's own has what a service of ours has, by one call."""

from __future__ import annotations

import logging
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, ClassVar

import pytest
from pydantic import Field

from zenoh_vision import Connection, Live, ServiceSettings, SourceError, run_service
from zenoh_vision.cli.service import program_name
from zenoh_vision.config.constraints import toml_file
from zenoh_vision.config.parameters import parameter
from zenoh_vision.messages import ParameterList


class DimmerSettings(ServiceSettings):
    env_prefix: ClassVar[str] = "ZV_DIMMER_"

    gain: Annotated[float, Field(ge=0, le=4, description="of the light"), Live("ratio")] = 1.0


Start = Callable[..., int]
Got = list[tuple[DimmerSettings, Connection]]


@pytest.fixture
def got() -> Got:
    """What the loop was called with."""
    return []


@pytest.fixture
def start(got: Got, monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    """Start ``dimmer.py`` with arguments; returns its exit status."""
    monkeypatch.setattr(threading, "excepthook", threading.excepthook)
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def run(settings: DimmerSettings, connection: Connection) -> None:
        """Dim the light.

        Slowly.

        Args:
            settings: Not for the user's eyes.
        """
        got.append((settings, connection))
        if settings.gain == 3:
            raise SourceError("the lamp is gone")
        if settings.gain == 4:
            raise KeyError("fuse")

    def start(*arguments: object) -> int:
        monkeypatch.setattr(sys, "argv", ["/opt/dimmer.py", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            run_service(run, DimmerSettings, examples=["python dimmer.py --gain 2"])
        assert isinstance(end.value.code, int)
        return end.value.code

    yield start
    for number, handler in handlers.items():
        signal.signal(number, handler)


def test_a_setting_is_a_flag_over_its_variable_over_the_file_over_the_default(
    start: Start, got: Got, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    file = tmp_path / "dimmer.toml"
    file.write_text('gain = 0.5\ncamera = "left"\n')
    assert start() == 0
    assert start("--config", file) == 0
    monkeypatch.setenv("ZV_DIMMER_GAIN", "0.25")
    assert start("--config", file) == 0
    assert start("--config", file, "--gain", "0.125") == 0
    gains = [(settings.gain, settings.camera) for settings, _ in got]
    assert gains == [(1.0, "front"), (0.5, "left"), (0.25, "left"), (0.125, "left")]


def test_the_connection_is_that_of_every_service(
    start: Start, got: Got, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("ZV_CONNECT", "tcp/10.0.0.5:7447")
    monkeypatch.setenv("ZV_NAMESPACE", "lab")
    assert start() == 0
    assert start("--connect", "tcp/10.0.0.6:7447", "--timeout", "5") == 0
    assert [each for _, each in got] == [
        Connection("tcp/10.0.0.5:7447", "lab"),
        Connection("tcp/10.0.0.6:7447", "lab", timeout_s=5.0),
    ]


def test_a_file_sets_the_connection_too_relative_to_itself(
    start: Start, got: Got, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    file = tmp_path / "dimmer.toml"
    file.write_text(
        "gain = 0.5\n[connection]\n"
        'credentials = "security/dimmer"\nnamespace = "lab"\ntimeout = "2s"\n'
    )
    own = str(tmp_path / "security" / "dimmer")
    assert start("--config", file) == 0
    monkeypatch.setenv("ZV_CREDENTIALS", "of_environment")
    assert start("--config", file) == 0
    assert start("--config", file, "--credentials", "of_flag") == 0
    assert [each for _, each in got] == [
        Connection(namespace="lab", credentials=credentials, timeout_s=2.0)
        for credentials in (own, "of_environment", "of_flag")
    ]
    assert {settings.gain for settings, _ in got} == {0.5}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("connection = 5", "connection = 5 is not allowed; allowed: a table [connection]"),
        (
            "[connection]\ncredentials = 5",
            "[connection]: credentials = 5 is not allowed (",
        ),
        (
            '[connection]\ncredential = "a"',
            "[connection]: unknown key 'credential'; did you",
        ),
        ('[connection]\nconnect = "nowhere"', "[connection]: connect = 'nowhere' is not allowed"),
    ],
)
def test_a_wrong_connection_in_a_file_is_named(
    start: Start, capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str, said: str
):
    file = tmp_path / "dimmer.toml"
    file.write_text(text)
    assert start("--config", file) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"dimmer: {file}: {said}")


def test_the_help_has_the_docstring_the_settings_and_the_examples(
    start: Start, capsys: pytest.CaptureFixture[str]
):
    assert start("--help") == 0
    text = capsys.readouterr().out
    assert text.startswith("Usage: dimmer [OPTIONS]\n\n  Dim the light.\n\n  Slowly.\n\nOptions:\n")
    assert all(words in text for words in ("--gain GAIN", "ZV_DIMMER_GAIN", "--connect"))
    assert "Args" not in text
    assert text.endswith("Example:\n  python dimmer.py --gain 2\n")


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["--gain", "9"], 2, "dimmer: command line: --gain = '9' is not allowed"),
        (["--gian", "1"], 2, "dimmer: no such option: --gian; did you mean --gain? see dimm"),
        (["--config", "/no/file.toml"], 3, "dimmer: /no/file.toml: No such file or directory"),
        (["--gain", "3"], 3, "dimmer: the lamp is gone"),
    ],
)
def test_an_error_is_one_line_and_a_status(
    start: Start, capsys: pytest.CaptureFixture[str], arguments: list[str], status: int, said: str
):
    assert start(*arguments) == status
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(said)


def test_a_bug_names_the_line_and_the_program(start: Start, capsys: pytest.CaptureFixture[str]):
    lines = Path(__file__).read_text().splitlines()
    number = lines.index('            raise KeyError("fuse")') + 1
    assert start("--gain", "4") == 70
    assert capsys.readouterr().err == (
        "dimmer: unexpected KeyError: 'fuse'; this is a bug in dimmer "
        f"(test_service.py, line {number}), --debug shows the traceback\n"
    )


def test_the_file_that_param_dump_writes_is_taken(start: Start, got: Got, tmp_path: Path):
    dimmed = parameter("dimmer_front", DimmerSettings(gain=2.5), "gain", 7)
    listed = ParameterList(node="dimmer_front", revision=7, parameters=(dimmed,))
    file = tmp_path / "dump.toml"
    file.write_text(toml_file(listed))
    assert start("--config", file) == 0
    assert got[0][0].gain == 2.5


@pytest.mark.parametrize("name", ["timeout", "config", "namespace"])
def test_a_setting_must_not_have_the_name_of_a_flag_of_every_service(name: str):
    taken = type("Taken", (ServiceSettings,), {"__annotations__": {name: str}, name: ""})
    with pytest.raises(ValueError, match=f"every service has --{name}"):
        run_service(lambda settings, connection: None, taken)


def test_a_variable_sets_what_has_no_default(start: Start, monkeypatch: pytest.MonkeyPatch):
    class Needy(ServiceSettings):
        env_prefix: ClassVar[str] = "ZV_NEEDY_"

        lamp: Annotated[str, Field(description="which one")]

    found: list[str] = []
    start()  # sets sys.argv
    monkeypatch.setenv("ZV_NEEDY_LAMP", "ceiling")
    with pytest.raises(SystemExit):
        run_service(lambda settings, _: found.append(settings.lamp), Needy)
    assert found == ["ceiling"]


@pytest.mark.parametrize(
    ("argument", "name"),
    [("blur.py", "blur"), ("/opt/x/blur", "blur"), ("/x/blur/__main__.py", "blur")],
)
def test_the_program_has_the_name_of_its_file(
    argument: str, name: str, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(sys, "argv", [argument])
    assert program_name() == name


def test_debug_logs_more(start: Start, monkeypatch: pytest.MonkeyPatch):
    told: list[dict[str, object]] = []
    monkeypatch.setattr(logging, "basicConfig", lambda **options: told.append(options))
    start()
    start("--debug")
    assert [each["level"] for each in told] == [logging.INFO, logging.DEBUG]
