"""What tests with real drivers do to them: take them away, bring them back, write pictures."""

from __future__ import annotations

import fcntl
import os
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from videodev2 import videodev2 as v4l2

from zv.camera.sources.v4l2.controls import Controls
from zv.camera.sources.v4l2.driver import Driver, code_of

DRIVER = Path("/sys/bus/platform/drivers/vivid")
BY_ID = Path("/dev/v4l/by-id")
NAMES = {
    "first": BY_ID / "usb-Test_Camera_A1-video-index0",
    "second": BY_ID / "usb-Test_Camera_B2-video-index0",
}
LOOPBACK = "/dev/video10"


def make_links(numbers: Sequence[int] = (0, 1)) -> None:
    """Make the stable paths lead to devices of these numbers."""
    BY_ID.mkdir(parents=True, exist_ok=True)
    for link, number in zip(NAMES.values(), numbers, strict=True):
        link.unlink(missing_ok=True)
        link.symlink_to(f"../../video{number}")


def unplug() -> None:
    """Take the cameras away, also while they are open."""
    for link in NAMES.values():
        link.unlink(missing_ok=True)
    (DRIVER / "unbind").write_text("vivid.0")


def plug_in() -> None:
    """Bring the cameras back, and their stable paths."""
    (DRIVER / "bind").write_text("vivid.0")
    nodes = sorted(Path("/sys/devices/platform/vivid.0/video4linux").iterdir())
    make_links([int(node.name.removeprefix("video")) for node in nodes[:2]])


def reset(path: Path) -> None:
    """Set the controls of a device to their defaults."""
    driver = Driver(str(path))
    try:
        controls = Controls(driver)
        for one in controls.parameters():
            flags = one.flags or ()
            changed = one.default is not None and one.value != one.default
            if changed and not {"read_only", "write_only"} & set(flags):
                with suppress(Exception):  # one that is locked or without effect now
                    controls.set({one.name.partition(".")[2]: one.default})
    finally:
        driver.close()


@contextmanager
def writing(pictures: Sequence[bytes], fourcc: str, size: tuple[int, int]) -> Iterator[None]:
    """Show pictures on the first device of v4l2loopback, one after the other, 20 a second."""
    fd = os.open(LOOPBACK, os.O_WRONLY)
    form = v4l2.v4l2_format()
    form.type = v4l2.V4L2_BUF_TYPE_VIDEO_OUTPUT
    form.fmt.pix.width, form.fmt.pix.height = size
    form.fmt.pix.pixelformat = code_of(fourcc)
    form.fmt.pix.field = v4l2.V4L2_FIELD_NONE
    form.fmt.pix.sizeimage = max(map(len, pictures))
    fcntl.ioctl(fd, v4l2.VIDIOC_S_FMT & 0xFFFFFFFF, form)
    stop, written = threading.Event(), threading.Event()

    def write() -> None:
        count = 0
        while not stop.wait(0.05):
            with suppress(BlockingIOError):
                os.write(fd, pictures[count % len(pictures)])
                written.set()
            count += 1

    thread = threading.Thread(target=write, daemon=True)
    thread.start()
    try:
        assert written.wait(30)  # only from then on does the device say that it delivers pictures
        yield
    finally:
        stop.set()
        thread.join()
        os.close(fd)
