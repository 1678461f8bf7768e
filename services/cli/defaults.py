"""Writes configs/*.toml and docs/configuration.md from the options' models.

``python -m services.cli.defaults``, or ``make configs``. A test holds the files to it.
"""

from __future__ import annotations

import json
import textwrap
from pathlib import Path

from common.settings import Settings, allowed
from services.catalogue import SERVICES, model_of
from services.cli.options import ConnectionSettings, flag

ROOT = Path(__file__).parent.parent.parent
WIDTH = 96


def toml_of(service: str) -> str:
    """Return a service's TOML file: every option with its default, meaning and range."""
    model = model_of(service)
    lines = [
        f"# Options of `zv {service}`, each with its default. Made by `make configs`.",
        f"# A flag ({flag('name')}) and the environment ({model.env_prefix}NAME) go over it.",
    ]
    for name, field in model.model_fields.items():
        words = f"{field.description}; {allowed(field, name, model)}"
        comment = textwrap.wrap(words, WIDTH, break_long_words=False, break_on_hyphens=False)
        lines += ["", *(f"# {line}" for line in comment)]
        if field.default is None:
            lines.append(f"# {name} =")
        else:
            lines.append(f"{name} = {json.dumps(field.default)}")
    return "\n".join(lines) + "\n"


def documentation() -> str:
    """Return docs/configuration.md."""
    parts = [
        "# Configuration\n",
        "Made by `make configs` from the options' models; do not edit.\n",
        "Each option can be given as a flag, as an environment variable, or in a TOML file "
        "(`--config FILE.toml`). A flag goes over the environment, that over the file, that over "
        "the default. An empty variable counts as not set. An unknown option is an error, "
        "exit status 2.\n",
        table("Every command", ConnectionSettings),
        *(table(f"`zv {service}`", model_of(service)) for service in SERVICES),
    ]
    return "\n".join(parts)


def table(title: str, model: type[Settings]) -> str:
    """Return the options of a model as a Markdown table."""
    rows = [
        f"## {title}\n",
        "| flag | environment | meaning | allowed |",
        "|---|---|---|---|",
    ]
    for name, field in model.model_fields.items():
        words = [field.description or "", allowed(field, name, model)]
        cells = [f"`{flag(name)}`", f"`{model.env_prefix}{name.upper()}`", *words]
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows) + "\n"


def files() -> dict[Path, str]:
    """Return every generated file and its text."""
    found = {ROOT / "configs" / f"{service}.toml": toml_of(service) for service in SERVICES}
    found[ROOT / "docs" / "configuration.md"] = documentation()
    return found


if __name__ == "__main__":
    for path, text in files().items():
        path.write_text(text)
