"""``zv track``: the tracks of a file as a table; or the objects of an image, found by a model."""

from __future__ import annotations

import logging
import time
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from zenoh_vision.errors import ConfigurationError, PayloadError, SourceError
from zenoh_vision.host.files import write_file
from zenoh_vision.image import codecs
from zenoh_vision.image.files import decoded
from zv.tracker.camera_tracking import detector_parameters
from zv.tracker.drawing import draw_boxes
from zv.tracker.file_options import FileOptions
from zv.tracker.pipelines.detector import kept_boxes
from zv.tracker.service import loaded_model
from zv.tracker.settings import TrackerSettings
from zv.tracker.table import write_table

log = logging.getLogger(__name__)

SUFFIXES: Final = (".png", ".jpg", ".jpeg")


def run(settings: TrackerSettings, options: FileOptions) -> None:
    """Write the tracks of a file, or find the objects of an image.

    Raises:
        ConfigurationError: A flag is missing, or does not fit.
        ExpectationNotMet: Told to stop, or a process ended.
        SourceError: A file cannot be read or written, or the model cannot be run.
    """
    if (options.file is None) == (options.image is None):
        raise ConfigurationError("give FILE, whose objects are tracked, or --image; not both")
    if options.file is not None:
        if options.out is None:
            raise ConfigurationError("-o tracks.csv: name the file for the tracks")
        write_table(settings, options.file, options.out)
        return
    draw_objects(settings, options)


def draw_objects(settings: TrackerSettings, options: FileOptions) -> None:
    """Print the objects of an image, the surest first, and write it with their boxes.

    Raises:
        ConfigurationError: There is no model, or a flag does not fit.
        SourceError: A file cannot be read or written, or the model cannot be run.
    """
    if settings.model is None:
        raise ConfigurationError("--image needs --model, the ONNX file of a detector")
    image = Path(options.image or "")
    out = Path(options.out or f"{image.stem}_boxes.jpg")
    if out.suffix.lower() not in SUFFIXES:
        raise ConfigurationError(f"--out {out}: allowed: a name that ends in {', '.join(SUFFIXES)}")
    if out.exists() and image.exists() and out.samefile(image):
        raise ConfigurationError(f"--out {out}: would overwrite --image; name another file")
    bgr = read_bgr(image, settings.max_pixels)
    model = loaded_model(settings.model_copy(update={"pipeline": "detector"}))
    begun_s = time.perf_counter()
    size = bgr.shape[1], bgr.shape[0]
    picture = model.prepared(size, lambda *_: bgr)
    found = model.detect([picture], settings.least_score, settings.suppression)[0]
    spent_ms = 1e3 * (time.perf_counter() - begun_s)
    log.info(
        "%s, layout %s, input %dx%d: %.0f ms", model.words, model.layout, *model.size, spent_ms
    )
    for count, why in ((found.not_finite, "NaN or infinite"), (found.left_out, "too many")):
        if count:
            log.warning("%d boxes of the model were left out: %s", count, why)
    boxes = [
        each
        for each in kept_boxes(found.detections, detector_parameters(settings))
        if each.score >= each.least
    ]
    write(out, draw_boxes(bgr, boxes), settings.quality)
    for each in boxes:
        left, top = round(each.region.left), round(each.region.top)
        width, height = round(each.region.width), round(each.region.height)
        print(f"{each.name} {each.score:.2f} {left},{top} {width}x{height}")
    if not boxes:
        log.info("no object with a score of at least %g (--least-score)", settings.least_score)
    log.info("%s: the image with %d boxes", out, len(boxes))


def read_bgr(image: Path, max_pixels: int) -> NDArray[np.uint8]:
    """Return an image file as (height, width, 3) uint8, BGR.

    Raises:
        SourceError: It cannot be read or decoded, or is too large.
    """
    try:
        data = image.read_bytes()
        if data.startswith((codecs.JPEG_START, codecs.PNG_START)):
            width, height = codecs.picture_size(data)
            if width * height > max_pixels:
                raise SourceError(
                    f"--image {image}: {width}x{height} pixels, at most {max_pixels} (--max-pixels)"
                )
        return decoded(data).in_8_bits("bgr8", None)
    except OSError as error:
        raise SourceError(f"--image {image}: {error.strerror or error}") from None
    except (ValueError, PayloadError) as error:
        raise SourceError(f"--image {image}: {error}") from None


def write(out: Path, bgr: NDArray[np.uint8], quality: int) -> None:
    """Write an image in the format of its suffix.

    Raises:
        SourceError: It cannot be written.
    """
    is_png = out.suffix.lower() == ".png"
    content = codecs.encode_png(bgr) if is_png else codecs.encode_jpeg(bgr, "bgr8", quality)
    write_file(out, content)
