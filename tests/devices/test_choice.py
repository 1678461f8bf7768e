"""What is asked of a real driver: what it offers, what it does not, who may open it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

from tests.support.cameras.drivers import NAMES
from zenoh_vision.errors import SourceError
from zv.camera.sources.base import DeviceWish
from zv.camera.sources.device import DeviceSource

FIRST = NAMES["first"]


@pytest.mark.parametrize(
    ("wish", "mode"),
    [
        (DeviceWish(), "YUYV 640x480 at 25 Hz"),
        (DeviceWish(width=320), "YUYV 320x180 at 30 Hz"),
        (DeviceWish(height=720), "YUYV 1280x720 at 12.5 Hz"),
        (DeviceWish(width=320, rate_hz=60), "YUYV 320x180 at 60 Hz"),
        (DeviceWish(width=640, height=360, rate_hz=11), "YUYV 640x360 at 12.5 Hz"),
        (DeviceWish(fourcc="NV12"), "NV12 640x480 at 25 Hz"),
        (DeviceWish(deep=True), "Y16 640x480 at 25 Hz"),
    ],
    ids=str,
)
def test_a_wish_is_granted_by_the_driver_as_it_was_chosen(wish: DeviceWish, mode: str):
    with closing(DeviceSource(0, wish)) as source:
        assert mode in source.description
        width, height = map(int, mode.split()[1].split("x"))
        assert source.read().picture.size == (width, height)


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        (DeviceWish(fourcc="ZZZZ"), "fourcc ZZZZ is not offered; offered: YUYV, UYVY,"),
        (
            DeviceWish(width=1280, height=720, rate_hz=60),
            "rate 60 Hz is not offered; offered: 1280x720: 12.5, 10, 5, 4, 2, 1 Hz "
            "(60 Hz at 320x180)",
        ),
        (DeviceWish(width=641), "size 641 x any height is not offered; offered: 320x180, 640x360"),
    ],
    ids=str,
)
def test_what_the_driver_does_not_offer_is_refused_with_what_it_does(wish: DeviceWish, words: str):
    with pytest.raises(SourceError) as caught:
        DeviceSource(0, wish)
    assert words in str(caught.value)


def test_pictures_are_as_old_as_the_driver_says_and_counted_by_its_numbers(opened: DeviceSource):
    assert "stamps of picture end" in opened.description
    for _ in range(5):
        read = opened.read()
        assert read.stamp_ns is not None
        assert 0 <= time.time_ns() - read.stamp_ns < 1e9


def test_pictures_that_were_not_read_in_time_are_counted(opened: DeviceSource):
    opened.read()
    time.sleep(1.5)
    lost = sum(opened.read().lost for _ in range(3))
    assert 15 <= lost <= 60  # at 25 Hz


def test_a_stamp_may_be_of_the_start_of_the_exposure():
    options = {"timestamp_source": "Start of Exposure"}
    with closing(DeviceSource(0, controls=options)) as source:
        assert "stamps of exposure start" in source.description


def test_two_devices_are_read_at_once():
    with closing(DeviceSource(0)) as one, closing(DeviceSource(1)) as other:
        for source in (one, other, one, other):
            assert source.read().picture.size == (640, 480)


def test_a_device_in_use_is_refused_with_the_program_that_uses_it(opened: DeviceSource):
    code = "from zv.camera.sources.device import DeviceSource; DeviceSource(0)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "/dev/video0: it is in use by " in done.stderr
    assert f"({os.getpid()})" in done.stderr


def test_a_forbidden_device_is_refused_with_the_way_out():
    code = (
        "import os; from zv.camera.sources.device import DeviceSource; os.setgid(65534); "
        "os.setuid(65534); DeviceSource(0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "/dev/video0: permission is missing" in done.stderr
    assert "usermod -aG video" in done.stderr


def test_a_missing_device_is_refused_with_those_that_exist_by_stable_paths():
    with pytest.raises(SourceError) as caught:
        DeviceSource(7)
    assert f"there is no such device; there are: {FIRST} (/dev/video0, vivid" in str(caught.value)


def test_the_list_has_every_device_with_formats_sizes_rates_and_controls():
    def listed(*flags: str) -> str:
        words = [sys.executable, "-m", "zv", "camera", "--list", *flags]
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout

    devices = [json.loads(line) for line in listed("--json").splitlines()]
    first = next(each for each in devices if each["node"] == "/dev/video0")
    assert (first["path"], first["driver"], first["error"]) == (str(FIRST), "vivid", None)
    formats = {each["fourcc"]: each for each in first["formats"]}
    assert formats["YUYV"]["usable"]
    assert not formats["HSV3"]["usable"]
    size = next(each for each in formats["YUYV"]["sizes"] if each["width"] == [640, 640, 1])
    assert size["rates_hz"][0] in (25.0, 40.0)
    gain = next(each for each in first["controls"] if each["name"] == "control.gain")
    assert (gain["type"], gain["maximum"], gain["flags"]) == (
        "int",
        255.0,
        ["inactive", "volatile"],
    )
    assert first["compound"]["u16_8x16_matrix"] == "8x16 u16"
    assert first["compound"]["u32_dynamic_array"] == "up to 100 u32"
    assert first["compound"]["area"] == "structure of 8 bytes"
    names = {each["name"].removeprefix("control.") for each in first["controls"]}
    assert not names & set(first["compound"])
    text = listed()
    assert "no parameters, since they are no single values: " in text
    assert "u16_8x16_matrix (8x16 u16)" in text
    assert text.startswith(f"{FIRST}  vivid\n  also /dev/video0\n")
    assert "1280x720   12.5, 10, 5, 4, 2, 1 Hz" in text
    assert Path("/dev/video1").exists()
    assert str(NAMES["second"]) in text
