"""The files in configs/ are what they say: made from the models, and readable."""

import tomllib
from pathlib import Path

import pytest
import zenoh

from zenoh_vision.config.settings import load_settings
from zv.cli.generate import files
from zv.registry import SERVICES, model_of

ROOT = Path(__file__).parent.parent


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
