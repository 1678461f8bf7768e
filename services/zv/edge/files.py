"""Finds the edges of an image file, or of all images of a folder, without a router."""

from __future__ import annotations

import logging
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.progress import track

from zenoh_vision.errors import ConfigurationError, PayloadError, SourceError
from zenoh_vision.host.files import write_file
from zenoh_vision.image import codecs
from zenoh_vision.image.depth import RangeFinder
from zenoh_vision.image.exif import UPRIGHT, orientation_of
from zenoh_vision.image.files import decoded, images_in
from zenoh_vision.image.forms import pack_bits
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.picture import picture_of
from zenoh_vision.messages import Header
from zv.edge.detectors.detection import STAGES
from zv.edge.detectors.rendering import Gray, as_sixteen_bits
from zv.edge.every_frame import is_of_frames, of_every_frame
from zv.edge.file_options import FileOptions
from zv.edge.finding import EdgesOfFrame
from zv.edge.service import read_mask
from zv.edge.settings import EdgeSettings

log = logging.getLogger(__name__)

SUFFIX_OF_FORMAT: Final = {"png": ".png", "jpeg": ".jpg", "bits": ".bits"}
ALLOWED: Final = {"--out": (".png", ".jpg", ".jpeg", ".bits"), "--strength": (".png",)}
"""The suffixes of a file of results, by flag."""

Places = dict[str, Path]
"""Where the results go, by flag: a file, or for ``--stages`` a folder."""


def run(settings: EdgeSettings, options: FileOptions) -> None:
    """Find the edges of one image or of all images of a folder, with a progress bar on a terminal.

    An image of a folder that cannot be read is logged and skipped.

    Raises:
        ConfigurationError: The flags contradict each other.
        SourceError: A file cannot be read or written. If images of a folder cannot be read, it is
            raised after all others were processed.
    """
    image = Path(options.image or "")
    if options.image is not None and image.exists() and is_of_frames(image):
        do_every_frame(image, settings, options)
        return
    jobs = planned(settings, options)
    mask = read_mask(settings.mask)
    if not Path(options.image or "").is_dir():
        do(*jobs[0], settings, mask)
        return
    failed = 0
    bar = Console(stderr=True)
    for image, places in track(jobs, "edges", console=bar, disable=not sys.stderr.isatty()):
        try:
            do(image, places, settings, mask)
        except UnreadableImage as error:
            failed += 1
            log.warning("%s", error)
    if failed:
        raise SourceError(f"{options.image}: {failed} of {len(jobs)} images cannot be used")


def do_every_frame(image: Path, settings: EdgeSettings, options: FileOptions) -> None:
    """Find the edges of each frame of a video or a recording; the results are numbered files.

    Raises:
        ConfigurationError: No folder for the results is given.
        SourceError: The file cannot be read, or a result cannot be written.
        ExpectationNotMet: Told to stop before the end.
    """
    given = given_places(options)
    check_places(given, is_folder=True)
    ends = endings(settings)

    def write(seq: int, found: EdgesOfFrame) -> None:
        places = {flag: place / f"{seq:06d}{ends[flag]}" for flag, place in given.items()}
        write_results(found, places, settings)

    count = of_every_frame(image, settings, read_mask(settings.mask), write)
    log.info("%s: the edges of %d frames", image, count)


def given_places(options: FileOptions) -> Places:
    """Return the places for results that the flags name.

    Raises:
        ConfigurationError: They name none.
    """
    flags = {"--out": options.out, "--strength": options.strength, "--stages": options.stages}
    given = {flag: Path(place) for flag, place in flags.items() if place is not None}
    if not given:
        raise ConfigurationError(
            "--image needs a file or folder for the results: --out, --stages or --strength"
        )
    return given


def endings(settings: EdgeSettings) -> dict[str, str]:
    """Return how the names of results in a folder end, by flag."""
    return {"--out": SUFFIX_OF_FORMAT[settings.format], "--strength": ".png", "--stages": ""}


class UnreadableImage(SourceError):
    """One image cannot be read or is refused; others may be usable."""


def planned(settings: EdgeSettings, options: FileOptions) -> list[tuple[Path, Places]]:
    """Check the flags, and return each image with the places of its results.

    Raises:
        ConfigurationError: The flags contradict each other, or a result would overwrite an image
            or another result.
        SourceError: There is no image, or a file where a folder is needed.
    """
    if options.image is None:
        raise ConfigurationError("--out, --stages and --strength need --image")
    given = given_places(options)
    image = Path(options.image)
    if not image.exists():
        raise SourceError(f"--image {image}: no such file or folder")
    check_places(given, is_folder=image.is_dir())
    jobs = [(image, given)]
    if image.is_dir():
        images = images_in(image)
        stems = Counter(file.stem for file in images)
        ends = endings(settings)
        # a.png and a.jpg become a.png.png and a.jpg.png.
        names = [file.stem if stems[file.stem] == 1 else file.name for file in images]
        jobs = [
            (file, {flag: place / f"{name}{ends[flag]}" for flag, place in given.items()})
            for file, name in zip(images, names, strict=True)
        ]
    taken = {identity(file): f"{file} of --image" for file, _ in jobs}
    for _, places in jobs:
        for flag, place, _ in results(places, settings):
            other = taken.setdefault(identity(place), f"{place} of {flag}")
            if other != f"{place} of {flag}":
                raise ConfigurationError(f"{flag} would overwrite {other}; name another place")
    return jobs


def check_places(given: Places, *, is_folder: bool) -> None:
    """Check that results can have their places, those of one image or of a folder of them.

    Raises:
        ConfigurationError: The suffix of a file is not allowed.
        SourceError: There is a file where a folder is needed.
    """
    for flag, place in given.items():
        if is_folder or flag not in ALLOWED:
            if place.exists() and not place.is_dir():
                raise SourceError(
                    f"{flag} {place}: is a file; allowed: a folder, or a name for a new one"
                )
        elif place.suffix.lower() not in ALLOWED[flag]:
            raise ConfigurationError(
                f"{flag} {place}: allowed: a name that ends in {', '.join(ALLOWED[flag])}"
            )


def identity(path: Path) -> object:
    """Return a key that is equal for all names of one file: device and inode, or the real path."""
    try:
        found = path.stat()
    except OSError:
        return path.resolve()
    return found.st_dev, found.st_ino


def results(
    places: Places, settings: EdgeSettings
) -> Iterator[tuple[str, Path, Callable[[EdgesOfFrame], bytes]]]:
    """Yield the flag and the file of each result, and what makes its content."""
    for flag, place in places.items():
        if flag == "--strength":
            yield flag, place, strength_png
        elif flag == "--out":
            yield flag, place, partial(edge_map, place.suffix.lower(), settings.quality)
        else:
            for name in STAGES:
                yield flag, place / f"{name}.png", partial(stage_png, name)
            yield flag, place / "final.png", partial(edge_map, ".png", 0)


def edge_map(suffix: str, quality: int, found: EdgesOfFrame) -> bytes:
    """Return the edge map in the format of a file suffix."""
    if suffix == ".bits":
        return pack_bits(found.edges)
    if suffix == ".png":
        return codecs.encode_png(found.edges, bilevel=True)
    return codecs.encode_jpeg(found.edges, "mono8", quality)


def stage_png(name: str, found: EdgesOfFrame) -> bytes:
    """Return a step as a PNG."""
    return codecs.encode_png(found.stages[name]())


def strength_png(found: EdgesOfFrame) -> bytes:
    """Return the strengths as a PNG of 16 bits per pixel."""
    return codecs.encode_png(as_sixteen_bits(found.strength, found.full_scale))


def do(image: Path, places: Places, settings: EdgeSettings, mask: Gray | None) -> None:
    """Find the edges of one image and write the requested results.

    Raises:
        UnreadableImage: The image cannot be read, or the settings refuse it.
        SourceError: A result cannot be written.
    """
    try:
        found = EdgesOfFrame(frame_of(image.read_bytes(), settings), settings, mask)
    except OSError as error:
        raise UnreadableImage(f"{image}: {error.strerror or error}") from None
    except (ValueError, PayloadError) as error:
        raise UnreadableImage(f"{image}: {error}") from None
    write_results(found, places, settings)


def write_results(found: EdgesOfFrame, places: Places, settings: EdgeSettings) -> None:
    """Write the requested results of one image or frame.

    Raises:
        SourceError: A result cannot be written.
    """
    for _, path, make in results(places, settings):
        content = make(found)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SourceError(f"{path}: cannot be written: {error.strerror or error}") from None
        write_file(path, content)


def frame_of(data: bytes, settings: EdgeSettings) -> Frame:
    """Return an image file as a frame, decoded as it would be if a camera published it.

    Raises:
        ValueError: It cannot be decoded.
        PayloadError: It is damaged or too large.
    """
    if data.startswith((codecs.JPEG_START, codecs.PNG_START)):
        check_pixels(*codecs.picture_size(data), settings)
    is_upright_jpeg = data.startswith(codecs.JPEG_START) and orientation_of(data) == UPRIGHT
    picture = picture_of(data, "bgr8") if is_upright_jpeg else decoded(data)
    width, height = picture.size
    check_pixels(width, height, settings)
    header = Header(
        camera="file",
        epoch=0,
        seq=0,
        stamp_ns=0,
        width=width,
        height=height,
        encoding=picture.encoding,
    )
    frame = Frame(header, picture)
    frame.find_range(RangeFinder((settings.depth_min, settings.depth_max)))
    return frame


def check_pixels(width: int, height: int, settings: EdgeSettings) -> None:
    """Check that a picture is not too large.

    Raises:
        PayloadError: ``too_large``.
    """
    if width * height > settings.max_pixels:
        raise PayloadError(
            "too_large", f"{width}x{height} pixels, at most {settings.max_pixels} (--max-pixels)"
        )
