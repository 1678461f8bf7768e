"""Puts the weights of the edge detector ``learned`` into the wheel, and their licence beside ours.

Hatchling runs it for every build. They are left out if the environment variable ``ZV_WEIGHTS`` is
set but empty: ``ZV_WEIGHTS= pip install .``; metadata and files then are of Apache-2.0
and, the library of the viewer's plots, of MIT.
"""

from __future__ import annotations

import os
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

FOLDER = "edge/detectors"
WEIGHTS = f"{FOLDER}/learned.onnx"
TERMS = f"services/zv/{FOLDER}/learned.md"
UPLOT_TERMS = "services/zv/viewer/page/vendor/LICENSE"


def with_weights() -> bool:
    """Tell whether to include the weights."""
    return os.environ.get("ZV_WEIGHTS", "yes") != ""


class Licence(MetadataHookInterface):
    """Sets the licence of what the wheel contains."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set the licence expression and the files with the terms."""
        more = with_weights()
        metadata["license"] = "Apache-2.0 AND MIT" + " AND LicenseRef-BSDS500-weights" * more
        metadata["license-files"] = ["LICENSE", UPLOT_TERMS, *([TERMS] if more else [])]


class Weights(BuildHookInterface[Any]):
    """Adds the file of the weights."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add it unless the build is an editable one, which has the whole checkout."""
        if with_weights() and version == "standard":
            build_data["force_include"][f"services/zv/{WEIGHTS}"] = f"zv/{WEIGHTS}"
