"""What a test of a service of one's own stands on: its router, its program, frames, messages."""

from __future__ import annotations

import subprocess
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path

import numpy as np
import pytest

from tests.support.processes import ROOT
from tests.support.waiting import POLL_S, wait_until
from zenoh_vision import Connection, Message, Node, Stamped, message_topic
from zenoh_vision.testing import (
    at,
    first_message,
    first_picture,
    publishing,
    running_router,
    running_service,
)

OWN = ROOT / "examples" / "own_service.py"


class Brightness(Stamped):
    schema_name = "my.Brightness.v1"

    mean: float


BRIGHTNESS = message_topic("brightness", Brightness)


def test_a_service_gets_the_frames_and_what_it_publishes_comes_back():
    grey = np.full((48, 64), 100, np.uint8)
    with (
        running_router() as endpoint,
        running_service([OWN, "--gain", "2", "--camera", "left"], endpoint) as process,
        publishing(endpoint, grey, camera="left"),
    ):
        found = first_message(endpoint, BRIGHTNESS, camera="left")
        assert found.mean == 200
        assert found.header.camera == "left"
    assert process.returncode == 0


def test_pictures_are_sent_one_after_the_other_again_and_again():
    pictures = [np.full((8, 8), level, np.uint8) for level in (10, 20)]
    with running_router() as endpoint, publishing(endpoint, *pictures, rate_hz=50):
        levels = []
        with Node("taker", connection=Connection(endpoint)) as node:
            for frame in node.frames("image", want="pixels", max_age_s=None):
                levels.append((frame.header.seq % 2, int(frame.pixels[0, 0])))
                if len(levels) == 4:
                    break
    assert set(levels) <= {(0, 10), (1, 20)}


class Charge(Message):
    schema_name = "my.Charge.v1"

    volts: float


CHARGE = message_topic("charge", Charge)


def test_a_message_without_a_header_is_found_too():
    with (
        running_router() as endpoint,
        Node("battery", connection=at(endpoint), publishes=[CHARGE]) as node,
        ThreadPoolExecutor(1) as reader,
    ):
        found = reader.submit(first_message, endpoint, CHARGE, timeout_s=5)
        while not found.done():  # the first may come before the subscription
            node.publish(CHARGE, Charge(volts=12.5))
            wait([found], POLL_S)
        assert found.result().volts == 12.5


def test_two_routers_are_two():
    with running_router() as one, running_router() as other:
        assert one != other


def test_no_message_is_an_error_that_names_the_key():
    with running_router() as endpoint, pytest.raises(AssertionError) as error:
        first_message(endpoint, "centroid", timeout_s=0.2)
    assert str(error.value) == "no message on vision/front/centroid within 0.2 s"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import sys; sys.exit('no lamp')", "ended by itself: no lamp"),
        (
            "import signal, sys\n"
            # Blocked, so that the signal cannot come just before the wait for it.
            "signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])\n"
            "open(sys.argv[1], 'w').close()\n"
            "signal.sigwait([signal.SIGINT])\n"
            "sys.exit(5)",
            "status 5",
        ),
    ],
    ids=["one that ends", "one that fails at its end"],
)
def test_a_service_that_does_not_run_to_its_end_is_an_error(tmp_path: Path, text: str, said: str):
    service, started = tmp_path / "service.py", tmp_path / "started"
    service.write_text(text)
    with (
        pytest.raises(AssertionError, match=said),
        running_service([service, started], "tcp/127.0.0.1:1") as process,
    ):
        wait_until(lambda: started.exists() or process.poll() is not None)


def miss_a_message(process: subprocess.Popen[bytes]) -> None:
    process.wait(30)
    raise AssertionError("no message")


def test_variables_of_the_user_do_not_reach_the_service(tmp_path: Path, monkeypatch):
    monkeypatch.setenv("ZV_BRIGHTNESS_GAIN", "1000")
    with (
        pytest.raises(AssertionError, match="ZV_BRIGHTNESS_GAIN = '11' is not allowed"),
        running_service([OWN], "tcp/127.0.0.1:1", ZV_BRIGHTNESS_GAIN="11") as process,
    ):
        miss_a_message(process)


def test_a_picture_that_a_service_makes_is_received():
    levels = [np.full((24, 32), level, np.uint8) for level in (50, 51)]
    with running_router() as endpoint, publishing(endpoint, *levels, camera="left"):
        frame = first_picture(endpoint, camera="left")
        assert (frame.header.camera, frame.header.width, frame.header.height) == ("left", 32, 24)
        assert int(frame.bgr[0, 0, 0]) in (50, 51)
        with pytest.raises(AssertionError, match="no picture on vision/rear/mask/compressed"):
            first_picture(endpoint, "mask/compressed", camera="rear", timeout_s=0.1)
