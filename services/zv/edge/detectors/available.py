"""The edge detectors by name, and their construction from settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Final

from zv.edge.detectors.canny import Canny
from zv.edge.detectors.colour import Colour
from zv.edge.detectors.detection import Detector
from zv.edge.detectors.gradient import Prewitt, Roberts, Scharr, Sobel
from zv.edge.detectors.haralick import Haralick
from zv.edge.detectors.laplacian_of_gaussian import LaplacianOfGaussian
from zv.edge.detectors.learned import Learned

DETECTORS: Final[Mapping[str, type[Detector]]] = {
    "canny": Canny,
    "roberts": Roberts,
    "sobel": Sobel,
    "prewitt": Prewitt,
    "scharr": Scharr,
    "laplacian_of_gaussian": LaplacianOfGaussian,
    "haralick": Haralick,
    "colour": Colour,
    "learned": Learned,
}
"""The classes of the detectors: frozen dataclasses whose fields have the names of settings."""


def detector_named(name: str, settings: Any) -> Detector:
    """Return a detector whose parameters are the attributes of ``settings`` with their names.

    Raises:
        KeyError: There is no detector of this name.
    """
    kind = DETECTORS[name]
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    return kind(**{each: getattr(settings, each) for each in names})
