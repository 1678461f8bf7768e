"""``zv edge --image``: the service's results on files, exit statuses, and what is refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support.headers import header
from tests.support.pictures.encoded import smooth
from tests.support.terminal import Terminal
from tests.support.typist import type_zv
from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.image import codecs
from zenoh_vision.image.forms import unpack_bits
from zenoh_vision.image.frame import Frame
from zv.edge.detectors.canny import Canny
from zv.edge.file_options import FileOptions
from zv.edge.files import run
from zv.edge.finding import EdgesOfFrame
from zv.edge.settings import EdgeSettings

PICTURE = smooth(96, 72, detail=8)
GRAY = cv2.cvtColor(PICTURE, cv2.COLOR_BGR2GRAY)


@pytest.fixture
def image(tmp_path: Path) -> Path:
    path = tmp_path / "in.png"
    path.write_bytes(codecs.encode_png(PICTURE))
    return path


def pixels(path: Path) -> np.ndarray:
    found = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert found is not None, path
    return found


def edge(*arguments: object, status: int = 0) -> str:
    """Run ``zv edge`` and return what it says on standard error."""
    done = type_zv(["edge", *map(str, arguments)])
    assert done.returncode == status, done.stderr
    assert done.stdout == ""
    return done.stderr


def test_the_map_of_a_file_is_that_of_the_service(image: Path, tmp_path: Path):
    out = tmp_path / "out.png"
    assert edge("--image", image, "--out", out, "--sigma", 2, "--high", 90) == ""
    assert np.array_equal(pixels(out), Canny(sigma=2, high=90).detect(GRAY).edges)


def test_a_jpeg_is_decoded_as_the_service_decodes_it(tmp_path: Path):
    jpeg = codecs.encode_jpeg(PICTURE, "bgr8", 80)
    (tmp_path / "in.jpg").write_bytes(jpeg)
    edge("--image", tmp_path / "in.jpg", "-o", tmp_path / "out.png")
    frame = Frame(header(width=96, height=72), jpeg)
    expected = EdgesOfFrame(frame, EdgeSettings()).edges
    assert np.array_equal(pixels(tmp_path / "out.png"), expected)


def test_all_results_of_one_image(image: Path, tmp_path: Path):
    stages, strength = tmp_path / "steps", tmp_path / "strength.png"
    edge("--image", image, "--stages", stages, "--strength", strength)
    names = {"smoothed", "magnitude", "direction", "suppressed", "thresholded", "final"}
    assert {path.stem for path in stages.iterdir()} == names
    found = Canny().detect(GRAY)
    assert np.array_equal(pixels(stages / "final.png"), found.edges)
    for name, make in found.stages.items():
        assert np.array_equal(pixels(stages / f"{name}.png"), make())
    deep = pixels(strength)
    assert deep.dtype == np.uint16
    expected = found.strength * (65535 / (255 * 4 * 2**0.5))  # both derivatives at their largest
    assert deep == pytest.approx(expected, abs=0.51)
    assert ((deep > 0) == (found.strength > 0)).all()


def test_the_map_can_be_packed_bits_or_a_jpeg(image: Path, tmp_path: Path):
    edge("--image", image, "--out", tmp_path / "map.bits")
    expected = Canny().detect(GRAY).edges
    assert np.array_equal(unpack_bits((tmp_path / "map.bits").read_bytes(), 96, 72), expected)
    edge("--image", image, "--out", tmp_path / "map.jpg", "--quality", 95)
    assert np.abs(pixels(tmp_path / "map.jpg").astype(int) - expected).mean() < 10


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three images, two of which have one name but for its end."""
    path = tmp_path / "in"
    path.mkdir()
    for name in ("a.png", "b.bmp", "b.png"):
        cv2.imwrite(str(path / name), PICTURE)
    (path / "notes.txt").write_text("no image")
    return path


def test_a_folder_of_images_gives_a_folder_of_maps(folder: Path, tmp_path: Path):
    out = tmp_path / "new" / "out"
    places = ("--out", out, "--stages", tmp_path / "steps", "--strength", tmp_path / "strength")
    edge("--image", folder, *places)
    for made in (out, tmp_path / "strength"):
        assert {path.name for path in made.iterdir()} == {"a.png", "b.bmp.png", "b.png.png"}
    assert (tmp_path / "steps" / "b.bmp" / "suppressed.png").exists()
    edge("--image", folder, "--out", tmp_path / "bits", "--format", "bits")
    assert (tmp_path / "bits" / "a.bits").stat().st_size == 96 // 8 * 72


def test_an_image_of_a_folder_that_cannot_be_read_is_named_and_the_others_are_done(
    folder: Path, tmp_path: Path
):
    (folder / "broken.png").write_bytes(codecs.encode_png(PICTURE)[:-20])
    said = edge("--image", folder, "--out", tmp_path / "out", status=3)
    assert "broken.png: corrupt" in said
    assert "1 of 4 images cannot be used" in said
    assert len(list((tmp_path / "out").iterdir())) == 3


def test_a_folder_shows_its_progress_on_a_terminal(folder: Path, tmp_path: Path):
    terminal = Terminal(["edge", "--image", str(folder), "--out", str(tmp_path / "out")])
    terminal.until(lambda shown: "100%" in shown)
    assert terminal.end() == 0


IN, INTO = "--image {image}", "--image {image} --out {folder}/o.png"


@pytest.mark.parametrize(
    ("line", "status", "words"),
    [
        (IN, 2, "--image needs a file or folder for the results"),
        ("--out {folder}/out.png", 2, "need --image"),
        (f"{IN} --out {{image}}", 2, "overwrite {image} of --image"),
        ("--image {folder} --out {folder}", 2, "overwrite {image} of --image"),
        (f"{IN} --strength {{folder}}/./in.png", 2, "overwrite {image} of"),
        (
            f"{INTO} --strength {{folder}}/./o.png",
            2,
            "--strength would overwrite {folder}/o.png of --out",
        ),
        (
            f"{IN} --stages {{folder}} --out {{folder}}/final.png",
            2,
            "--stages would overwrite {folder}/final.png of --out",
        ),
        (f"{IN} --out {{folder}}/out.gif", 2, "allowed: a name that ends in"),
        (f"{IN} --strength {{folder}}/s.jpg", 2, "ends in .png"),
        ("--image {folder}/none.png --out {folder}/out.png", 3, "no such file"),
        ("--image {folder} --out {image}", 3, "--out {image}: is a file; allowed: a fol"),
        ("--image {folder} --strength {image}", 3, "--strength {image}: is a file; all"),
        (f"{IN} --stages {{image}}", 3, "--stages {image}: is a file; allowed:"),
        (f"{IN} --out {{image}}/o.png", 3, "{image}/o.png: cannot be written"),
        (f"{INTO} --low 120", 2, "is above high"),
        (f"{INTO} --aperture 4", 2, "aperture"),
        (f"{INTO} --max-pixels 1000", 3, "96x72 pixels, at most 1000"),
        (f"{INTO} --region 96,0,5,5", 3, "outside of a frame of 96x72"),
        (f"{INTO} --mask {{folder}}/x", 3, "--mask"),
    ],
)
def test_unusable_flags_are_refused_in_one_line(image: Path, line: str, status: int, words: str):
    places = {"image": str(image), "folder": str(image.parent)}
    assert words.format(**places) in edge(*line.format(**places).split(), status=status)
    assert not (image.parent / "o.png").exists()


def test_steps_do_not_overwrite_the_image(tmp_path: Path):
    """It is named like a step, and a link beside it is another name of the same file."""
    image = tmp_path / "smoothed.png"
    image.write_bytes(before := codecs.encode_png(PICTURE))
    (tmp_path / "link").mkdir()
    (tmp_path / "link" / "final.png").hardlink_to(image)
    for folder in (tmp_path, tmp_path / "link"):
        with pytest.raises(ConfigurationError, match=r"would overwrite .*smoothed.png of --image"):
            run(EdgeSettings(), FileOptions(image=str(image), stages=str(folder)))
    assert image.read_bytes() == before


ODD = {
    "one pixel": np.full((1, 1), 9, np.uint8),
    "one row": np.arange(200, dtype=np.uint8)[np.newaxis],
    "one column": np.arange(200, dtype=np.uint8)[:, np.newaxis],
    "all black": np.zeros((30, 40), np.uint8),
    "16 bits": GRAY.astype(np.uint16) * 257,
    "16 bits of colour": PICTURE.astype(np.uint16) * 257,
    "alpha": np.dstack([PICTURE, np.full((72, 96), 7, np.uint8)]),
}


EXPECTED = {
    "16 bits": np.rint(1 + GRAY * (254 / 255)).astype(np.uint8),  # 0 is no reading
    "16 bits of colour": GRAY,
    "alpha": GRAY,
}
"""The grey pictures in which edges are found."""
assert GRAY.min() > 0


@pytest.mark.parametrize("detector", ["canny", "colour", "haralick", "laplacian_of_gaussian"])
@pytest.mark.parametrize("name", ODD)
def test_images_of_unusual_formats_have_correct_maps(tmp_path: Path, name: str, detector: str):
    (tmp_path / "in.png").write_bytes(codecs.encode_png(ODD[name]))
    settings = EdgeSettings.model_validate(
        {"detector": detector, "depth_min": 0, "depth_max": 65535}
    )
    options = FileOptions(
        image=str(tmp_path / "in.png"),
        out=str(tmp_path / "out.png"),
        stages=str(tmp_path / "stages"),
        strength=str(tmp_path / "strength.png"),
    )
    run(settings, options)
    found = pixels(tmp_path / "out.png")
    assert found.shape == ODD[name].shape[:2]
    if name in EXPECTED and detector == "canny":
        assert found.any()
        assert np.array_equal(found, Canny().detect(EXPECTED[name]).edges)
    if name == "all black":
        assert not found.any()


def test_8000x6000_pixels_are_refused_before_they_are_decoded(tmp_path: Path):
    path = tmp_path / "large.png"
    path.write_bytes(codecs.encode_png(np.zeros((6000, 8000), np.uint8), bilevel=True))
    with pytest.raises(SourceError, match="too_large"):
        run(EdgeSettings(), FileOptions(image=str(path), out=str(tmp_path / "out.png")))
