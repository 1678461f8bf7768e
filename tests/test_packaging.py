"""The distribution's import names are its own: no other distribution ships them."""

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from email import message_from_bytes
from importlib.metadata import distributions
from pathlib import Path

import pytest

from zenoh_vision.config.settings import load_settings
from zenoh_vision.errors import ConfigurationError
from zv.edge.settings import EdgeSettings

ROOT = Path(__file__).parent.parent


def test_no_other_installed_distribution_ships_our_top_level_names():
    for distribution in distributions():
        if distribution.metadata["Name"] != "zenoh-vision":
            tops = {path.parts[0].removesuffix(".py") for path in distribution.files or ()}
            assert not tops & {"zenoh_vision", "zv"}, distribution.metadata["Name"]


def test_opencv_is_installed_once_and_headless():
    names = {distribution.metadata["Name"].lower() for distribution in distributions()}
    assert {name for name in names if name.startswith("opencv")} == {"opencv-python-headless"}


def test_a_wheel_cannot_be_uploaded_by_mistake():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert "Private :: Do Not Upload" in project["classifiers"]


TERMS = "services/zv/edge/detectors/learned.md"
UPLOT = "services/zv/viewer/page/vendor/LICENSE"


@pytest.mark.parametrize(
    ("weights", "expression", "files"),
    [
        (None, "Apache-2.0 AND MIT AND LicenseRef-BSDS500-weights", ["LICENSE", TERMS, UPLOT]),
        ("", "Apache-2.0 AND MIT", ["LICENSE", UPLOT]),
    ],
    ids=["as it is", "without the weights"],
)
def test_the_licence_of_a_wheel_is_that_of_what_is_in_it(tmp_path, weights, expression, files):
    environment = {name: value for name, value in os.environ.items() if name != "ZV_WEIGHTS"}
    environment |= {} if weights is None else {"ZV_WEIGHTS": weights}
    command = [sys.executable, "-m", "build", "--wheel", "--outdir", tmp_path, ROOT]
    subprocess.run(command, check=True, capture_output=True, env=environment)
    (wheel,) = tmp_path.iterdir()
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (metadata,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        about = message_from_bytes(archive.read(metadata))
    folder = metadata.removesuffix("METADATA")
    assert ("zv/edge/detectors/learned.onnx" in names) == (TERMS in files)
    assert about["License-Expression"] == expression
    assert about.get_all("License-File") == files
    assert {f"{folder}licenses/{name}" for name in files} <= set(names)


def test_without_its_weights_learned_is_refused_with_the_reason(tmp_path, monkeypatch):
    monkeypatch.setattr("zv.edge.settings.WEIGHTS", tmp_path / "learned.onnx")
    with pytest.raises(ConfigurationError, match=r"built without the weights .* not Apache-2\.0"):
        load_settings(EdgeSettings, flags={"detector": "learned"})
    assert load_settings(EdgeSettings, flags={"detector": "colour"}).detector == "colour"


def test_the_label_of_an_image_follows_the_flag_that_its_wheel_follows():
    lines = (ROOT / "Dockerfile").read_text()
    assert lines.count("ARG ZV_WEIGHTS=yes\n") == 2  # of the stage that builds, and of the image
    assert 'licenses="Apache-2.0 AND MIT${ZV_WEIGHTS:+ AND LicenseRef-BSDS500-weights}"' in lines


def locked(name: str) -> dict[str, str]:
    """Return the versions in a file of ``make lock``, each of which has hashes."""
    text = (ROOT / "requirements" / f"{name}.txt").read_text()
    assert "://" not in text
    entries = re.findall(
        r"^([\w.-]+)==(\S+)((?:.*\\\n)(?: +--hash=sha256:[0-9a-f]{64}.*\n)+)", text, re.M
    )
    assert len(entries) == len(re.findall(r"^\w", text, re.M))
    return {normalized(package): version for package, version, _ in entries}


def normalized(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def test_every_file_that_is_installed_at_run_time_has_a_hash_and_the_tested_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    tested = dict(line.split("==") for line in lines if "==" in line)
    tested = {normalized(name): version for name, version in tested.items()}
    runtime, memory, build = locked("runtime"), locked("shm"), locked("build")
    for found in (runtime, memory, build):
        assert found == {name: tested[name] for name in found}, "run: make lock"
    needed = project["dependencies"], project["optional-dependencies"]["shm"]
    for wanted, found in zip(needed, (runtime, memory), strict=True):
        names = {normalized(re.match(r"[\w.-]+", each)[0]) for each in wanted}
        assert names <= found.keys(), "run: make lock"
    assert runtime.items() <= memory.items()
    assert "hatchling" in build


def test_make_up_and_the_image_install_only_what_has_a_hash():
    for name in ("Makefile", "Dockerfile"):
        text = (ROOT / name).read_text()
        text = text.partition("$(VENV)/.dev:")[0] if name == "Makefile" else text
        installs = re.findall(r"pip[^\n]* install (?:.*\\\n)*.*", text)
        runtime = [each for each in installs if "--group" not in each]
        assert len(runtime) >= 3, name
        assert all("--require-hashes" in each or "--no-deps" in each for each in runtime), runtime


def test_constraints_pin_every_runtime_dependency_and_name_no_index():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    text = (ROOT / "constraints.txt").read_text()
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert all(line.count("==") == 1 and "://" not in line for line in lines)
    pinned = {line.split("==")[0].lower() for line in lines}
    wanted = {dependency.split(">=")[0].lower() for dependency in project["dependencies"]}
    assert wanted <= pinned
