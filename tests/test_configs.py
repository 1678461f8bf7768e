"""The files in configs/ are what they say: made from the models, and readable."""

import re
import tomllib
from pathlib import Path

import pytest
import zenoh

from zenoh_vision.config.settings import load_settings
from zv.cli.generate import files
from zv.registry import SERVICES, model_of

ROOT = Path(__file__).parent.parent
IN_CONTAINERS = ("camera", "tracker", "edge", "viewer")
"""Services whose options docker-compose.yml passes on."""


@pytest.mark.parametrize("path", sorted(files()), ids=lambda path: path.name)
def test_the_file_is_what_make_configs_writes(path: Path):
    assert path.read_text() == files()[path]


@pytest.mark.parametrize("service", SERVICES)
def test_a_services_file_holds_every_option_and_its_default(service: str):
    path = ROOT / "configs" / f"{service}.toml"
    model = model_of(service)
    assert load_settings(model, config=path) == model()
    text = path.read_text()
    written = set(tomllib.loads(text))
    unset = {name for name, field in model.model_fields.items() if field.default is None}
    assert written == set(model.model_fields) - unset
    assert all(f"# {name} =" in text for name in unset)


def test_zenoh_accepts_the_routers_file():
    config = zenoh.Config.from_file(ROOT / "configs" / "router.json5")
    assert config.get_json("mode") == '"router"'
    assert config.get_json("scouting/multicast/enabled") == "false"
    assert config.get_json("transport/shared_memory/enabled") == "false"


@pytest.mark.parametrize("service", IN_CONTAINERS)
def test_every_option_of_a_service_can_be_set_for_its_container(service: str):
    text = (ROOT / "docker-compose.yml").read_text()
    prefix = model_of(service).env_prefix
    block = re.search(rf"^  {service}:\n(.*?)(?=^  \w|\Z)", text, re.MULTILINE | re.DOTALL)
    assert block
    found = set(re.findall(rf"^      ({prefix}\w+):", block[1], re.MULTILINE))
    assert found == {f"{prefix}{name.upper()}" for name in model_of(service).model_fields}


def test_env_example_names_every_variable_of_the_compose_files_and_no_other():
    example = (ROOT / ".env.example").read_text()
    named = set(re.findall(r"^#(\w+)=", example, re.MULTILINE))
    used = set()
    for file in (ROOT / "docker-compose.yml", *ROOT.glob("configs/compose/*.yml")):
        used |= set(re.findall(r"\$\{(\w+)", file.read_text()))
    options = {
        f"{model_of(service).env_prefix}{name.upper()}"
        for service in IN_CONTAINERS
        for name in model_of(service).model_fields
    }
    assert named - {"COMPOSE_FILE"} <= used  # Compose's own
    assert used - named <= options  # .env.example points to docs/configuration.md for these
