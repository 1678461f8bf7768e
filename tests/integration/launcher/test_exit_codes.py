"""How a service ends that cannot work: one line on standard error, nothing on standard output."""

from __future__ import annotations

import re
import time

import pytest
import zenoh

from tests.support.fork_server import ZV
from tests.support.listening import Listener
from tests.support.processes import START_S, Program
from tests.support.routing import Router
from tests.support.typist import type_zv
from tests.support.waiting import wait_until

MISTAKES = {
    "unknown flag": (["tracker", "--historie", "9"], ["--historie"]),
    "not a number": (["tracker", "--history", "many"], ["--history", "'many'", "from 1 to 100000"]),
    "out of range": (["edge", "--sigma", "99"], ["--sigma", "'99'", "from 0 to 20"]),
    "not a choice": (["edge", "--aperture", "4"], ["--aperture", "'4'", "3, 5, 7"]),
    "no name": (
        ["tracker", "--camera", "Front!"],
        ["--camera", "'Front!'", "letters a-z, digits and _"],
    ),
    "two that do not fit": (["edge", "--low", "200", "--high", "100"], ["low", "200", "high"]),
    "no endpoint": (["camera", "--connect", "localhost"], ["--connect", "'localhost'", "tcp"]),
    "unknown encoding": (
        ["camera", "--encoding", "yuyv"],
        ["--encoding", "'yuyv'", "mono8, mono16, bgr8, rgb8, bgra8, rgba8"],
    ),
    "no endpoint to listen on": (["router", "--listen", "7447"], ["--listen", "'7447'", "tcp"]),
    "unknown command": (["trakker"], ["trakker"]),
}


@pytest.mark.parametrize(("arguments", "named"), MISTAKES.values(), ids=MISTAKES.keys())
def test_wrong_use_is_2_and_says_what_is_allowed(arguments, named):
    said = failure(*arguments, status=2)
    missing = [text for text in named if text not in said]
    assert not missing, said


def failure(*arguments: object, status: int, **variables: str) -> str:
    """Run ``zv`` to its end, and return what it said on standard error."""
    done = type_zv(arguments, **variables)
    assert (done.returncode, done.stdout) == (status, ""), done.stderr
    assert "Traceback" not in done.stderr
    # rich draws a box around wrong flags and breaks lines in it
    return re.sub(r"[\s│╭╮╰╯─]+", " ", done.stderr)


def test_a_wrong_key_in_a_file_is_2_and_names_file_key_and_the_nearest(tmp_path):
    file = tmp_path / "edge.toml"
    file.write_text("sigmma = 2\n")
    said = failure("edge", "--config", file, status=2)
    assert all(text in said for text in (str(file), "'sigmma'", "did you mean 'sigma'")), said


def test_a_wrong_value_in_the_environment_is_2_and_names_the_variable():
    said = failure("edge", status=2, ZV_EDGE_HIGH="steep")
    assert all(text in said for text in ("ZV_EDGE_HIGH", "'steep'", "from 0 to 100000")), said


@pytest.mark.parametrize(
    "source",
    ["/no/such/walk.avi", "tmp:text.avi", "tmp:empty folder", "/dev/video97", "gopher://x/y"],
)
def test_a_source_that_cannot_be_opened_is_3_and_named(router, tmp_path, source):
    (tmp_path / "text.avi").write_text("this is no video\n" * 100)
    (tmp_path / "empty folder").mkdir()
    source = source.replace("tmp:", f"{tmp_path}/")
    said = failure("camera", "--connect", router.endpoint, "--source", source, status=3)
    assert source in said


def test_no_router_within_the_timeout_is_4_and_says_how_to_start_one(tmp_path):
    endpoint = Router(tmp_path).endpoint  # nobody listens there
    started_s = time.monotonic()
    said = failure("tracker", "--connect", endpoint, "--timeout", 1.5, status=4)
    assert time.monotonic() - started_s >= 1.5
    assert endpoint in said
    assert "1.5 s" in said
    assert "zv router" in said
    assert "--connect" in said


def test_a_taken_port_is_2_and_names_the_way_out(router):
    said = failure("router", "--listen", router.endpoint, status=2)
    assert all(text in said for text in (router.endpoint, "in use", "--connect", "--listen")), said


def test_without_a_timeout_a_service_waits_on(tmp_path):
    router = Router(tmp_path)
    flags = ["tracker", "--connect", router.endpoint]
    with Program(flags, tmp_path, "waiting", forked=ZV) as program:
        end_s = time.monotonic() + 2
        wait_until(lambda: time.monotonic() > end_s or program.process.poll() is not None)
        assert program.process.poll() is None
        assert program.output == ""


def test_a_file_that_was_played_once_is_0_and_the_token_goes(client, service, video):
    listener = Listener(client, "vision/front/image/compressed")
    tokens: list[zenoh.SampleKind] = []
    told = client.liveliness().declare_subscriber(
        "@vision/node/camera_front", lambda sample: tokens.append(sample.kind)
    )
    camera = service("camera", "--source", video)
    assert camera.process.wait(START_S) == 0, camera.complaints
    wait_until(lambda: tokens == [zenoh.SampleKind.PUT, zenoh.SampleKind.DELETE])
    told.undeclare()
    wait_until(lambda: listener.messages)
    assert camera.output == ""
