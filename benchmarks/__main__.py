"""``make bench``: every figure of one run as JSON, ratios to the floor of the same run."""

from __future__ import annotations

import argparse
import json
import platform
from collections.abc import Callable

import cv2

from benchmarks import (
    detector,
    devices,
    edges,
    encrypted,
    fleet,
    floor,
    network_camera,
    parameters,
    recorder,
    replay,
    stream,
    tracker,
    ways,
)
from benchmarks.growth import measuring as growth
from benchmarks.growth import report as growth_report
from benchmarks.material import VIDEO, frames
from benchmarks.peers import comparison, report
from benchmarks.quality.data import found
from benchmarks.tools import cost as tools
from benchmarks.tools import exporter
from benchmarks.viewer import clients as viewer
from benchmarks.viewer import painted
from tests.devices import machine
from zenoh_vision.host.parallel import workers

SIZES = ((768, 576), (1920, 1080))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--seconds", type=float, default=15, help="of each measurement")
    parser.add_argument("--memory-minutes", type=float, default=0, help="watch memory so long")
    parser.add_argument("--cameras", type=int, default=8, help="in the fleet")
    for name in PARTS:
        parser.add_argument(f"--only-{name}", action="store_true", help=PARTS[name].__doc__)
    parser.add_argument("--page", action="store_true", help="write docs/performance.md with it")
    options = parser.parse_args()
    chosen = [name for name in PARTS if getattr(options, f"only_{name}")]
    cv2.setNumThreads(1)
    workers.limit(1)
    print(f"# {platform.machine()}, Python {platform.python_version()}, OpenCV {cv2.__version__}")
    for name in chosen or PARTS:
        PARTS[name](options)


def measure_services(options: argparse.Namespace) -> None:
    """Measure streams, start-up, fleet and memory."""
    for width, height in SIZES:
        pictures = frames(width, height)
        before = floor.measure(pictures, stream.RATE_HZ, options.seconds / 2)
        found = stream.plain_stream(width, height, options.seconds, before)
        after = floor.measure(pictures, stream.RATE_HZ, options.seconds / 2)
        found["floor_after_ms"] = round(after.total_ms, 3)
        show(f"{width}x{height}, camera to decoded frame", found)
        show(
            f"{width}x{height}, with tracker and edge",
            stream.with_services(width, height, options.seconds),
        )
    show("start-up, s", stream.start_up())
    show("fleet", fleet.cameras(options.cameras, 10.0, max(options.seconds, 30)))
    show("help, s", exporter.help_times())
    for number in (4, 40):
        show(f"zv metrics, {number} nodes", exporter.cost(number, options.seconds))
    if options.memory_minutes:
        show("memory", fleet.cameras(1, 30.0, options.memory_minutes * 60))


def measure_ways(options: argparse.Namespace) -> None:
    """Measure frames through shared memory, as raw pixels and as JPEG."""
    for size in SIZES:
        show(f"{size[0]}x{size[1]}, ways of a frame", ways.measure(*size, options.seconds))


def measure_encrypted(options: argparse.Namespace) -> None:
    """Measure frames by TLS with certificates beside frames by TCP."""
    for size in SIZES:
        figures = encrypted.measure(*size, options.seconds)
        show(f"{size[0]}x{size[1]}, TLS beside TCP", figures)


def measure_edges(_: argparse.Namespace) -> None:
    """Measure the edge detectors."""
    for size in ((640, 480), *SIZES):
        show(f"{size[0]}x{size[1]}, edges of a frame", edges.measure(*size))


def measure_tools(options: argparse.Namespace) -> None:
    """Measure what the tools cost beside the least that a program can do."""
    width, height = SIZES[1]
    name = f"tools, {tools.STREAMS} streams of {width}x{height}"
    show(name, tools.cpu_beside_bare(width, height, stream.RATE_HZ, options.seconds))
    show("zv topic echo of one camera's centroids", tools.cpu_of_echo(options.seconds))
    show("watching four nodes", tools.cpu_of_watching(options.seconds))
    show("parameter set to first frame with it", parameters.set_to_frame(options.seconds))
    show("zv snapshot, start to file, s", tools.snapshot())


def measure_viewer(options: argparse.Namespace) -> None:
    """Measure what browsers cost."""
    name = f"viewer, {viewer.WIDTH}x{viewer.HEIGHT} at {viewer.RATE_HZ:g} Hz"
    show(f"{name}, CPU", viewer.cpu_for_clients(options.seconds))
    show(f"{name}, capture to client", viewer.ages(options.seconds))
    if options.memory_minutes:
        show(f"{name}, clients that come and go", viewer.memory(options.memory_minutes * 60))


def measure_painted(options: argparse.Namespace) -> None:
    """Measure when a browser paints what a camera captured."""
    reason = painted.why_not()
    if reason:
        print(f"# capture to painted pixel: not measured: {reason}", flush=True)
        return
    name = f"{viewer.WIDTH}x{viewer.HEIGHT} at {painted.RATE_HZ:g} Hz, capture to painted pixel"
    show(name, painted.capture_to_painted(options.seconds * painted.SHARE))


def measure_tracker(options: argparse.Namespace) -> None:
    """Measure the robust pipeline beside the tutorial's, and trackers of large frames."""
    if found(VIDEO):
        show("tracker, 768x576, CPU with decode", tracker.cpu_beside_tutorial(2 * options.seconds))
    name = f"{tracker.CAMERAS} cameras of {tracker.WIDTH}x{tracker.HEIGHT}, a tracker each"
    for pipeline, edges_too in (("tutorial", False), ("robust", False), ("robust", True)):
        show(name, tracker.large_cameras(options.seconds, pipeline, edges=edges_too))


def measure_detector(options: argparse.Namespace) -> None:
    """Measure what the pipeline of models adds to a model, and what an empty scene costs."""
    show("detector, 768x576, beside the bare model", detector.overhead(options.seconds))
    show("detector, empty scene with on_motion", detector.empty_scene(options.seconds))


def measure_recorder(options: argparse.Namespace) -> None:
    """Measure what recording costs, and the opening of a large file."""
    width, height = recorder.WIDTH, recorder.HEIGHT
    name = (
        f"recorder, {len(recorder.CAMERAS)} cameras of {width}x{height} at {recorder.RATE_HZ:g} Hz"
    )
    show(name, recorder.recording(options.seconds))
    show("opening a recording", recorder.opening())


def measure_replay(options: argparse.Namespace) -> None:
    """Measure how exactly a recording is played, and how fast a tracker is verified."""
    size = f"{replay.WIDTH}x{replay.HEIGHT} at {replay.RATE_HZ:g} Hz"
    show(f"zv bag play, {size}", replay.played(options.seconds))
    show(f"zv bag verify, {size}, one core", replay.verified(max(options.seconds, 30.0)))


def measure_peers(options: argparse.Namespace) -> None:
    """Compare capture to decoded frame with other systems."""
    rows = comparison.compare(options.seconds * comparison.SHARE)
    for size in comparison.SIZES:
        print(f"\n{report.table(rows, size)}", flush=True)
    if options.page:
        report.write_page(rows)


def measure_growth(options: argparse.Namespace) -> None:
    """Measure cost by number of cameras, number of subscribers and frame size."""
    seconds = options.seconds * growth.SHARE
    found = growth_report.growths(
        growth.of_cameras(seconds), growth.of_subscribers(seconds), growth.of_pixels(seconds)
    )
    for each in found:
        print(f"\n{each.title}\n\n{growth_report.table(each)}", flush=True)
        print(f"\n{growth_report.verdict(each)}", flush=True)
    if options.page:
        growth_report.write_page(found)


def measure_network(options: argparse.Namespace) -> None:
    """Measure the delay of an RTSP camera beside ffmpeg and GStreamer."""
    reason = network_camera.why_not()
    if reason:
        print(f"# RTSP camera: not measured: {reason}", flush=True)
        return
    show("RTSP, 640x480, picture to pixels", network_camera.measure(options.seconds))


def show(name: str, figures: object) -> None:
    """Print one block of figures."""
    print(f"{name}: {json.dumps(figures, indent=2)}", flush=True)


def measure_devices(_: argparse.Namespace) -> None:
    """Measure how devices are read, beside OpenCV's capture, in a virtual machine."""
    try:
        print("# devices, in a virtual machine", flush=True)
        devices.measure()
    except machine.CannotRun as error:
        print(f"# devices: not measured: {error}", flush=True)


PARTS: dict[str, Callable[[argparse.Namespace], None]] = {
    "services": measure_services,
    "ways": measure_ways,
    "encrypted": measure_encrypted,
    "edges": measure_edges,
    "tools": measure_tools,
    "viewer": measure_viewer,
    "painted": measure_painted,
    "tracker": measure_tracker,
    "detector": measure_detector,
    "recorder": measure_recorder,
    "replay": measure_replay,
    "network": measure_network,
    "peers": measure_peers,
    "growth": measure_growth,
    "devices": measure_devices,
}


if __name__ == "__main__":
    main()
