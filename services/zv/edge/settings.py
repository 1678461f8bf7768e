"""The edge detector's options; flags, configuration files and live parameters derive from them."""

from __future__ import annotations

from importlib.resources import files
from typing import Annotated, ClassVar, Final, Literal, Self

from pydantic import Field, model_validator

from zenoh_vision.config.consumer_options import (
    DepthMax,
    DepthMin,
    FrameTransport,
    MaxAge,
    check_depth_range,
)
from zenoh_vision.config.parameters import Live
from zenoh_vision.config.region import REGION_FORM, REGION_PATTERN, box_of
from zenoh_vision.config.settings import FromText, LocalPath, ServiceSettings
from zenoh_vision.messages import Box

LEAST_LAPLACIAN_SIGMA: Final = 0.5
WEIGHTS: Final = files("zv.edge.detectors") / "learned.onnx"
"""Those of the detector ``learned``: not in a wheel that was built without them."""


class EdgeSettings(ServiceSettings):
    """Options of ``zv edge``."""

    env_prefix: ClassVar[str] = "ZV_EDGE_"

    detector: Annotated[
        Literal[
            "canny",
            "roberts",
            "sobel",
            "prewitt",
            "scharr",
            "laplacian_of_gaussian",
            "haralick",
            "colour",
            "learned",
        ],
        Field(description="how edges are found"),
        Live(),
    ] = "canny"
    density: Annotated[
        float,
        Field(
            ge=0,
            le=10,
            description="of colour and learned, their only parameter: wanted share of edge pixels "
            "in an average picture",
        ),
        Live("percent"),
    ] = 3.5
    sigma: Annotated[
        float,
        Field(
            ge=0,
            le=20,
            description="Gaussian smoothing, pixels; 0: none; at least 0.5 for "
            "laplacian_of_gaussian",
        ),
        Live("pixels"),
    ] = 1.4
    low: Annotated[
        float,
        Field(ge=0, le=100_000, description="of canny: gradients below it are not edges"),
        Live(),
    ] = 40.0
    high: Annotated[
        float,
        Field(
            ge=0,
            le=100_000,
            description="of canny: gradients above it are edges, and those above low that touch "
            "them; of the others: the only threshold",
        ),
        Live(),
    ] = 100.0
    aperture: Annotated[
        Literal[3, 5, 7],
        FromText,
        Field(description="side of canny's Sobel kernel, pixels"),
        Live("pixels"),
    ] = 3
    l2: Annotated[
        bool,
        Field(
            description="gradient magnitude sqrt(gx^2 + gy^2) instead of |gx| + |gy|, of canny, "
            "roberts, sobel, prewitt and scharr"
        ),
        Live(),
    ] = True
    window: Annotated[
        Literal[5, 7, 9, 11],
        FromText,
        Field(description="side of the window of haralick's cubic, pixels"),
        Live("pixels"),
    ] = 5
    region: Annotated[
        str,
        Field(
            max_length=40,
            pattern=REGION_PATTERN,
            description="part of the frame in which edges are found: X,Y,WIDTH,HEIGHT in pixels; "
            "empty: all of it",
        ),
        REGION_FORM,
        Live(),
    ] = ""
    scale: Annotated[
        float,
        Field(
            ge=0.1,
            le=1,
            description="factor by which frames are reduced before edges are found; results stay "
            "in pixels of the whole frame",
        ),
        Live(),
    ] = 1.0
    mask: Annotated[
        str | None,
        Field(
            min_length=1,
            description="image file: no edges where it is black; it is stretched to the frame",
        ),
        LocalPath(),
    ] = None
    contours: Annotated[
        int,
        Field(ge=0, le=1000, description="most polylines, and most segments, in edges/contours"),
        Live(),
    ] = 100
    contour_min: Annotated[
        int,
        Field(ge=1, le=10_000, description="least number of pixels of a line in edges/contours"),
        Live("pixels"),
    ] = 10
    contour_tolerance: Annotated[
        float,
        Field(ge=0, le=50, description="largest distance of polylines from the edges' pixels"),
        Live("pixels"),
    ] = 1.0
    circles: Annotated[bool, Field(description="find circles for edges/contours"), Live()] = False
    format: Annotated[
        Literal["png", "jpeg", "bits"],
        Field(
            description="png is lossless; jpeg also has values between 0 and 255; bits: packed, "
            "one bit per pixel"
        ),
        Live(),
    ] = "png"
    quality: Annotated[int, Field(ge=1, le=100, description="JPEG quality, for jpeg"), Live()] = 80
    transport: FrameTransport = "auto"
    depth_min: DepthMin = None
    depth_max: DepthMax = None
    max_age: MaxAge = 0.4
    max_pixels: Annotated[
        int,
        Field(
            ge=1,
            le=7680 * 4320,
            description="width times height; larger frames are dropped. One frame needs up to 42 "
            "bytes of memory per pixel",
        ),
    ] = 4096 * 2304

    @property
    def box(self) -> Box | None:
        """The region as x, y, width and height; None for the whole frame."""
        return box_of(self.region)

    @model_validator(mode="after")
    def _has_weights(self) -> Self:
        if self.detector == "learned" and not WEIGHTS.is_file():
            raise ValueError(
                "detector = learned is not available: this zv was built without the weights of "
                "learned, whose licence is not Apache-2.0; allowed: the other detectors"
            )
        return self

    @model_validator(mode="after")
    def _sigma_fits(self) -> Self:
        if self.detector == "laplacian_of_gaussian" and self.sigma < LEAST_LAPLACIAN_SIGMA:
            raise ValueError(
                f"sigma = {self.sigma:g} is too small for laplacian_of_gaussian, whose second "
                f"derivative falls between the pixels; allowed: at least {LEAST_LAPLACIAN_SIGMA:g}"
            )
        return self

    @model_validator(mode="after")
    def _thresholds_in_order(self) -> Self:
        if self.low > self.high:
            raise ValueError(
                f"low = {self.low:g} is above high = {self.high:g}; allowed: low at most high"
            )
        return self

    _depth_in_order = model_validator(mode="after")(check_depth_range)
