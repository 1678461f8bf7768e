"""Runs a command in a virtual machine whose kernel has webcams: ``vivid`` and ``v4l2loopback``.

QEMU without KVM, so it runs anywhere, and five to fifteen times slower than outside. The machine
sees the files of this one, and what it writes is lost with it. Debian's packages only: its kernel
is unpacked into a cache, not installed.

    python -m tests.devices.machine [--loopback N] [--seconds S] -- COMMAND [ARGUMENT ...]

The exit status is that of the command; 124: it took too long; 125: the machine did not start.
"""

from __future__ import annotations

import argparse
import os
import platform
import secrets
import shlex
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path

PROGRAMS = {"qemu-system-x86_64": "qemu-system-x86", "busybox": "busybox-static"} | {
    "modprobe": "kmod",
    "cpio": "cpio",
    "dpkg-deb": "dpkg",
    "apt-get": "apt",
}
"""The programs that are needed, and the packages of Debian that have them."""

CACHE = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "zenoh-vision-machine"
MODULES = ("virtio_pci", "9pnet_virtio", "9p", "overlay", "vivid")
CAMERAS = "n_devs=3 node_types=0x1,0x1,0x1 multiplanar=1,1,2"
"""Three cameras of ``vivid``: /dev/video0 and 1, and /dev/video2 with the interface of planes."""

FIRST_LOOPBACK = 10
TOO_LONG, NOT_STARTED = 124, 125
MEMORY_MB = 3072

INIT = """#!/bin/busybox sh
/bin/busybox --install -s /bin
mount -t proc proc /proc
mount -t sysfs sysfs /sys
mount -t devtmpfs devtmpfs /dev
exec >/dev/ttyS1 2>&1
while read -r module options; do insmod "/modules/$module" $options; done </modules/order
mount -t 9p -o trans=virtio,version=9p2000.L,msize=262144,cache=loose,ro root /below
mount -t tmpfs -o size=75% tmpfs /above
mkdir -p /above/files /above/work
mount -t overlay overlay -o lowerdir=/below,upperdir=/above/files,workdir=/above/work /whole
for each in proc sys dev; do mount --move "/$each" "/whole/$each"; done
mkdir -p /whole/dev/shm /whole/dev/pts
mount -t tmpfs tmpfs /whole/dev/shm
mount -t tmpfs tmpfs /whole/run
mount -t devpts devpts /whole/dev/pts
ip link set lo up
cp /job /whole/run/job
chroot /whole /bin/bash /run/job
echo "{mark} $?"
sync
poweroff -f
"""


class CannotRun(Exception):
    """The machine cannot be made here; the text says what is missing."""


def missing() -> str:
    """Return what this machine lacks to run the other one; empty if nothing."""
    if platform.machine() != "x86_64" or sys.platform != "linux":
        return "the virtual machine is made for Linux on x86-64"
    lacking = [package for program, package in PROGRAMS.items() if shutil.which(program) is None]
    return f"not installed: {', '.join(lacking)}" if lacking else ""


def run(command: Sequence[str], *, loopback: int = 0, seconds: float = 600.0) -> int:
    """Run a command in the virtual machine, its output on standard output; return its status.

    Args:
        command: Program and arguments; it starts in this working directory.
        loopback: Number of devices of ``v4l2loopback``, from /dev/video10 on, which show what
            another program writes into them.
        seconds: Longest time.

    Raises:
        CannotRun: Something is missing.
    """
    lacking = missing()
    if lacking:
        raise CannotRun(lacking)
    release = _kernel()
    modules = _modules(release, loopback)
    with tempfile.TemporaryDirectory() as folder:
        mark = f"status-{secrets.token_hex(8)}"
        image = _image(Path(folder), modules, command, mark)
        return _boot(release, image, Path(folder) / "console", mark, seconds)


def _kernel() -> str:
    """Return the release of Debian's kernel, unpacked into the cache."""
    CACHE.mkdir(parents=True, exist_ok=True)
    marker = CACHE / "release"
    if not marker.exists():
        _download(_depended("linux-image-amd64", "linux-image-"), CACHE / "kernel")
        (release,) = [each.name for each in (CACHE / "kernel/lib/modules").iterdir()]
        _ran("depmod", "-b", str(CACHE / "kernel"), release)
        marker.write_text(release)
    return marker.read_text()


def _modules(release: str, loopback: int) -> list[tuple[Path, str]]:
    """Return the files of the kernel's modules in the order of loading, with their options."""
    found: dict[Path, str] = {}
    for name in MODULES:
        listed = _ran(
            "modprobe", "-d", str(CACHE / "kernel"), "-S", release, "--show-depends", name
        )
        for line in listed.splitlines():
            if line.startswith("insmod"):
                file = Path(line.split()[1])
                found.setdefault(file, CAMERAS if file.name.startswith("vivid.") else "")
    if loopback:
        numbers = ",".join(str(FIRST_LOOPBACK + each) for each in range(loopback))
        exclusive = ",".join("1" * loopback)
        options = f"devices={loopback} video_nr={numbers} exclusive_caps={exclusive}"
        found[_loopback_module(release)] = options
    return list(found.items())


def _loopback_module(release: str) -> Path:
    """Return the module of v4l2loopback, built in the cache of Debian's sources."""
    module = CACHE / "v4l2loopback.ko"
    if module.exists():
        return module
    headers = f"linux-headers-{release}"
    if not Path(f"/usr/src/{headers}").exists():
        _ran("apt-get", "install", "-y", "-qq", "--no-install-recommends", headers, "gcc", "make")
    _download("v4l2loopback-dkms", CACHE / "loopback")
    (folder,) = (CACHE / "loopback").glob("usr/src/v4l2loopback-*")
    _ran("make", "-s", "-C", f"/usr/src/{headers}", f"M={folder}", "modules")
    _ran("strip", "-g", str(folder / "v4l2loopback.ko"), "-o", str(module))
    return module


def _image(
    folder: Path, modules: Sequence[tuple[Path, str]], command: Sequence[str], mark: str
) -> Path:
    """Return a file system for the start: busybox, the modules, the command."""
    root = folder / "image"
    for name in ("bin", "modules", "proc", "sys", "dev", "below", "above", "whole"):
        (root / name).mkdir(parents=True)
    shutil.copy(str(shutil.which("busybox")), root / "bin/busybox")
    for file, _ in modules:
        shutil.copy(file, root / "modules")
    order = "".join(f"{file.name} {options}\n" for file, options in modules)
    (root / "modules/order").write_text(order)
    kept = {name: os.environ.get(name, "") for name in ("PATH", "HOME", "CI")}
    lines = [f"cd {shlex.quote(os.getcwd())} || exit 1"]
    lines += [f"export {name}={shlex.quote(value)}" for name, value in kept.items() if value]
    (root / "job").write_text("\n".join([*lines, shlex.join(command), ""]))
    init = root / "init"
    init.write_text(INIT.replace("{mark}", mark).replace("</order", "</modules/order"))
    init.chmod(0o755)
    image = folder / "image.cpio"
    names = "\n".join(str(each.relative_to(root)) for each in sorted(root.rglob("*")))
    with image.open("wb") as output:
        subprocess.run(
            ["cpio", "-o", "-H", "newc", "--quiet"],
            input=names.encode(),
            stdout=output,
            cwd=root,
            check=True,
        )
    return image


def _boot(release: str, image: Path, console: Path, mark: str, seconds: float) -> int:
    """Start the machine, pass on the output of its command, and return the command's status."""
    words = ["qemu-system-x86_64", "-accel", "tcg,thread=multi", "-cpu", "max", "-smp", "2"]
    words += ["-m", str(MEMORY_MB), "-display", "none", "-no-reboot", "-nodefaults"]
    words += ["-kernel", str(CACHE / f"kernel/boot/vmlinuz-{release}"), "-initrd", str(image)]
    words += ["-append", "console=ttyS0 quiet panic=-1"]
    words += ["-serial", f"file:{console}", "-serial", "stdio"]
    words += ["-fsdev", "local,id=root,path=/,security_model=none,readonly=on,multidevs=remap"]
    words += ["-device", "virtio-9p-pci,fsdev=root,mount_tag=root"]
    machine = subprocess.Popen(
        words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, errors="replace"
    )
    alarm = threading.Timer(seconds, machine.kill)
    alarm.daemon = True
    alarm.start()
    status: int | None = None
    try:
        assert machine.stdout is not None
        for line in machine.stdout:
            if line.startswith(mark):
                status = int(line.split()[1])
            else:
                print(line.rstrip("\r\n"), flush=True)
        machine.wait()
    finally:
        machine.kill()
        in_time = alarm.is_alive()
        alarm.cancel()
    if status is None:
        print("\n".join(console.read_text(errors="replace").splitlines()[-20:]), file=sys.stderr)
        return NOT_STARTED if in_time else TOO_LONG
    return status


def _download(package: str, folder: Path) -> None:
    """Unpack a package of Debian, without installing it."""
    with tempfile.TemporaryDirectory() as place:
        _ran("apt-get", "download", "-qq", package, cwd=place)
        (file,) = Path(place).glob("*.deb")
        _ran("dpkg-deb", "-x", str(file), str(folder))


def _depended(package: str, begin: str) -> str:
    """Return the package that another one depends on, by the beginning of its name."""
    for attempt in range(2):
        listed = _ran("apt-cache", "depends", package)
        for line in listed.splitlines():
            kind, _, name = line.strip().partition(": ")
            if kind == "Depends" and name.startswith(begin):
                return name
        if not attempt:
            _ran("apt-get", "update", "-qq")
    raise CannotRun(f"apt knows no {package}")


def _ran(*words: str, cwd: str | None = None) -> str:
    done = subprocess.run(words, capture_output=True, text=True, cwd=cwd, check=False)
    if done.returncode:
        raise CannotRun(f"{shlex.join(words)}: {done.stderr.strip()[-500:]}")
    return done.stdout


def main() -> int:
    """Run the command of the command line; where that is impossible, skip it, or fail in CI."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--loopback", type=int, default=0, help="devices of v4l2loopback")
    parser.add_argument("--seconds", type=float, default=600.0, help="longest time")
    parser.add_argument("command", nargs="+")
    given = parser.parse_args()
    try:
        return run(given.command, loopback=given.loopback, seconds=given.seconds)
    except CannotRun as error:
        in_ci = os.environ.get("CI") == "true"
        print(f"{'failed' if in_ci else 'skipped'}: {error}", file=sys.stderr)
        return 1 if in_ci else 0


if __name__ == "__main__":
    sys.exit(main())
