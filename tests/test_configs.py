"""The files in configs/ are what they say: made from the models, and readable."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml
import zenoh

from docs.generate import IN_CONTAINERS, files
from zenoh_vision.config.settings import load_settings
from zv.launcher.launch_tables import GRACE_S
from zv.registry import SERVICES, model_of

ROOT = Path(__file__).parent.parent


def test_the_files_are_what_make_configs_writes():
    assert [path.name for path, text in files().items() if path.read_text() != text] == []


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
    compose = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
    variables = compose["services"][service]["environment"]
    model = model_of(service)
    names = {f"{model.env_prefix}{name.upper()}" for name in model.model_fields}
    assert names == {name for name in variables if name.startswith(model.env_prefix)}
    given = {name for name in names if variables[name] is not None}  # the others pass through
    assert given <= {
        f"{model.env_prefix}{name}"
        for name in ("CAMERA", "HOST", "PORT", "ADDRESS", "OUTPUT", "EVENTS_DIR")
    }


def test_containers_have_the_time_to_end_that_zv_up_gives_its_nodes():
    compose = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
    times = {service["stop_grace_period"] for service in compose["services"].values()}
    assert times == {f"{GRACE_S:g}s"}


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
    assert named - {"COMPOSE_FILE"} - options <= used  # Compose's own
    assert used - named <= options  # .env.example points to docs/configuration.md for these
