"""Finds the edges of an image file, or of all images of a folder, without a router."""

from __future__ import annotations

import logging
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from zenoh_vision.errors import ConfigurationError, PayloadError, SourceError
from zenoh_vision.image import codecs, depth
from zenoh_vision.image.bits import pack_bits
from zenoh_vision.image.depth import RangeFinder
from zenoh_vision.image.files import decode_image, images_in, is_turned
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.pixel_formats import encoding_of
from zenoh_vision.messages import Header
from zv.edge.detectors.detection import STAGES, Gray
from zv.edge.detectors.rendering import as_sixteen_bits
from zv.edge.file_options import FileOptions
from zv.edge.finding import EdgesOfFrame
from zv.edge.service import read_mask
from zv.edge.settings import EdgeSettings

log = logging.getLogger(__name__)

SUFFIX_OF_FORMAT: Final = {"png": ".png", "jpeg": ".jpg", "bits": ".bits"}
MAP_SUFFIXES: Final = (".png", ".jpg", ".jpeg", ".bits")
FINAL: Final = "final"
"""Name of the edge map among the steps."""


@dataclass(frozen=True, slots=True)
class Job:
    """One image and the files of its results.

    Attributes:
        image: The image file.
        out: File of the edge map; None if it is not wanted.
        stages: Folder of the steps; None if they are not wanted.
        strength: File of the strengths, a PNG; None if they are not wanted.
    """

    image: Path
    out: Path | None
    stages: Path | None
    strength: Path | None

    def results(self) -> Iterator[tuple[str, Path]]:
        """Yield the flag and the file of each result."""
        if self.out is not None:
            yield "--out", self.out
        if self.strength is not None:
            yield "--strength", self.strength
        if self.stages is not None:
            for name in (*STAGES, FINAL):
                yield "--stages", stage_file(self.stages, name)


def stage_file(folder: Path, name: str) -> Path:
    """Return the file of a step."""
    return folder / f"{name}.png"


def run(settings: EdgeSettings, options: FileOptions) -> None:
    """Find the edges of one image or of all images of a folder, with a progress bar on a terminal.

    An image of a folder that cannot be read is logged and skipped.

    Raises:
        ConfigurationError: The flags contradict each other.
        SourceError: A file cannot be read or written. If images of a folder cannot be read, it is
            raised after all others were processed.
    """
    jobs = planned(settings, options)
    mask = read_mask(settings.mask)
    if not Path(options.image or "").is_dir():
        do(jobs[0], settings, mask)
        return
    failed = 0
    for job in with_progress(jobs):
        try:
            do(job, settings, mask)
        except UnreadableImage as error:
            failed += 1
            log.warning("%s", error)
    if failed:
        raise SourceError(f"{options.image}: {failed} of {len(jobs)} images cannot be used")


class UnreadableImage(SourceError):
    """One image cannot be read or is refused; others may be usable."""


def planned(settings: EdgeSettings, options: FileOptions) -> list[Job]:
    """Check the flags and return a job for each image.

    Raises:
        ConfigurationError: The flags contradict each other.
        SourceError: There is no image, or a file where a folder is needed.
    """
    if options.image is None:
        raise ConfigurationError("--out, --stages and --strength need --image")
    if options.out is None and options.stages is None and options.strength is None:
        raise ConfigurationError(
            "--image needs a file or folder for the results: --out, --stages or --strength"
        )
    image = Path(options.image)
    if not image.exists():
        raise SourceError(f"--image {image}: no such file or folder")
    places = [None if each is None else Path(each) for each in (options.out, options.strength)]
    out, strength = places
    stages = None if options.stages is None else Path(options.stages)
    job = Job(image, out, stages, strength)
    jobs = _jobs_of_folder(job, settings) if image.is_dir() else [job]
    if image.is_dir():
        check_folder("--out", out)
        check_folder("--strength", strength)
    else:
        if out is not None:
            check_suffix("--out", out, MAP_SUFFIXES)
        if strength is not None:
            check_suffix("--strength", strength, (".png",))
    check_folder("--stages", stages)
    check_places(jobs)
    return jobs


def check_places(jobs: Sequence[Job]) -> None:
    """Check that no result overwrites an image or another result.

    Raises:
        ConfigurationError: A result would overwrite a file; the text names both.
    """
    taken = {identity(job.image): f"{job.image} of --image" for job in jobs}
    for job in jobs:
        for flag, place in job.results():
            other = taken.setdefault(identity(place), f"{place} of {flag}")
            if other != f"{place} of {flag}":
                raise ConfigurationError(f"{flag} would overwrite {other}; name another place")


def identity(path: Path) -> object:
    """Return a key that is equal for all names of one file: device and inode, or the real path."""
    try:
        found = path.stat()
    except OSError:
        return path.resolve()
    return found.st_dev, found.st_ino


def check_suffix(flag: str, path: Path, allowed: Iterable[str]) -> None:
    """Check the suffix of a file that is to be written.

    Raises:
        ConfigurationError: The suffix is not allowed.
    """
    if path.suffix.lower() not in allowed:
        raise ConfigurationError(
            f"{flag} {path}: allowed: a name that ends in {', '.join(allowed)}"
        )


def check_folder(flag: str, path: Path | None) -> None:
    """Check that a path of results is a folder or does not exist; None means no results.

    Raises:
        SourceError: It is a file.
    """
    if path is not None and path.exists() and not path.is_dir():
        raise SourceError(f"{flag} {path}: is a file; allowed: a folder, or a name for a new one")


def _jobs_of_folder(places: Job, settings: EdgeSettings) -> list[Job]:
    images = images_in(places.image)
    stems = Counter(file.stem for file in images)
    jobs = []
    for file in images:
        # a.png and a.jpg become a.png.png and a.jpg.png.
        name = file.stem if stems[file.stem] == 1 else file.name
        suffix = SUFFIX_OF_FORMAT[settings.format]
        jobs.append(
            Job(
                file,
                places.out and places.out / f"{name}{suffix}",
                places.stages and places.stages / name,
                places.strength and places.strength / f"{name}.png",
            )
        )
    return jobs


def with_progress(jobs: list[Job]) -> Iterator[Job]:
    """Yield jobs, with a progress bar on standard error if that is a terminal."""
    if not sys.stderr.isatty():
        yield from jobs
        return
    from rich.console import Console
    from rich.progress import track

    yield from track(jobs, "edges", console=Console(stderr=True))


def do(job: Job, settings: EdgeSettings, mask: Gray | None) -> None:
    """Find the edges of one image and write the requested results.

    Raises:
        UnreadableImage: The image cannot be read, or the settings refuse it.
        SourceError: A result cannot be written.
    """
    try:
        found = EdgesOfFrame(read_frame(job.image, settings), settings, mask)
    except OSError as error:
        raise UnreadableImage(f"{job.image}: {error.strerror or error}") from None
    except (ValueError, PayloadError) as error:
        raise UnreadableImage(f"{job.image}: {error}") from None
    if job.out is not None:
        write(job.out, encoded(found.edges, job.out.suffix.lower(), settings.quality))
    if job.strength is not None:
        strength = as_sixteen_bits(found.strength, found.full_scale)
        write(job.strength, codecs.encode_png(strength))
    if job.stages is not None:
        for name, make in found.stages.items():
            write(stage_file(job.stages, name), codecs.encode_png(make()))
        write(stage_file(job.stages, FINAL), codecs.encode_png(found.edges, bilevel=True))


def encoded(edges: Gray, suffix: str, quality: int) -> bytes:
    """Return an edge map encoded in the format of a file suffix."""
    if suffix == ".bits":
        return pack_bits(edges)
    if suffix == ".png":
        return codecs.encode_png(edges, bilevel=True)
    return codecs.encode_jpeg(edges, "mono8", quality)


def write(path: Path, content: bytes) -> None:
    """Write a file; create its folder if needed.

    Raises:
        SourceError: It cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    except OSError as error:
        raise SourceError(f"{path}: cannot be written: {error.strerror or error}") from None


def read_frame(path: Path, settings: EdgeSettings) -> Frame:
    """Read an image file as a frame, decoded as it would be if a camera published it.

    Raises:
        OSError: It cannot be read.
        ValueError: It cannot be decoded.
        PayloadError: It is damaged or too large.
    """
    data = path.read_bytes()
    if data.startswith((codecs.JPEG_START, codecs.PNG_START)):
        _check_pixels(*codecs.picture_size(data), settings)
    if data.startswith(codecs.JPEG_START) and not is_turned(data):
        width, height = codecs.picture_size(data)
        frame = Frame(_header(width, height, "bgr8"), compressed=data)
    else:
        pixels = decode_image(data)
        if pixels.ndim == 3 and pixels.dtype == np.uint16:
            pixels = depth.eight_bits(pixels)
        height, width = pixels.shape[:2]
        _check_pixels(width, height, settings)
        finder = RangeFinder()
        finder.limits = settings.depth_min, settings.depth_max
        header = _header(width, height, encoding_of(pixels))
        frame = Frame(header, pixels=pixels, finder=finder)
    return frame


def _header(width: int, height: int, encoding: str) -> Header:
    return Header(
        camera="file", epoch=0, seq=0, stamp_ns=0, width=width, height=height, encoding=encoding
    )


def _check_pixels(width: int, height: int, settings: EdgeSettings) -> None:
    if width * height > settings.max_pixels:
        raise PayloadError(
            "too_large", f"{width}x{height} pixels, at most {settings.max_pixels} (--max-pixels)"
        )
