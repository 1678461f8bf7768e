"""Keeps the compressed pictures of a camera within its setting ``max_kbps``."""

from __future__ import annotations

import logging
import threading
import time
from dataclasses import replace

import cv2

from zenoh_vision.image.frame import Frame
from zenoh_vision.image.pixel_formats import DEEP
from zv.camera.bandwidth import Plan, RateControl
from zv.camera.convert import decoded, is_unchanged
from zv.camera.reader import CapturedFrame
from zv.camera.sources.base import Picture

log = logging.getLogger(__name__)

PARTS = {1: "full size", 2: "a half of each side", 4: "a quarter of each side"}


class StreamLimit:
    """Makes pictures smaller before they are published, and decides which are sent compressed.

    The size holds for every subscriber, since a frame has one size. Quality and rate hold only for
    compressed pictures: raw pixels and shared memory take no share of the budget.

    Attributes:
        words: How pictures differ from the settings, for diagnostics; empty if they do not.
    """

    def __init__(self) -> None:
        self.words = ""
        self._control: RateControl | None = None
        self._kbps = 0
        self._lock = threading.Lock()  # protects the control, which the thread of queries uses too
        self._lossless = False
        self._packet: bytes | None = None
        self._epoch = 0
        self._flawed_epoch: int | None = None  # the epoch whose JPEGs cannot be passed on
        self._divisor = 1

    def fit(self, captured: CapturedFrame, now_s: float) -> tuple[Picture, int]:
        """Return the picture to publish, and its JPEG quality.

        Raises:
            PayloadError: ``corrupt``: a JPEG must be made smaller and cannot be decoded.
        """
        settings, picture = captured.revision.settings, captured.picture
        if settings.max_kbps is None:
            self._control, self.words = None, ""
            self._log_size(1)
            return picture, settings.quality
        control = self._control or RateControl()
        self._lossless = settings.encoding in DEEP
        self._epoch = captured.epoch
        passes = is_unchanged(picture, settings.encoding, settings.flip)
        self._packet = picture.jpeg if passes and self._epoch != self._flawed_epoch else None
        self._kbps = settings.max_kbps
        with self._lock:
            plan = control.plan(
                now_s,
                settings.max_kbps * 1000 / 8,
                settings.quality,
                lossless=self._lossless,
                packet=None if self._packet is None else len(self._packet),
            )
        self._control = control  # queries may ask it from its first plan on
        if not plan.untouched or plan.divisor > 1:
            self._packet = None
        self.words = self._report(plan, control, settings.max_kbps, settings.quality)
        self._log_size(plan.divisor)
        if plan.divisor > 1 or (picture.jpeg is not None and self._packet is None):
            picture = reduced(picture, plan.divisor)
        return picture, plan.quality

    def may_send(self, frame: Frame) -> bool:
        """Tell whether to send the compressed frame of the picture that was fitted last.

        Raises:
            PayloadError: It cannot be encoded.
        """
        control = self._control
        if control is None:
            return True
        with self._lock:
            if not control.is_due():
                return False
        passed_on = self._packet is not None and frame.compressed is self._packet
        if self._packet is not None and not passed_on:
            self._flawed_epoch = self._epoch
        size = len(frame.compressed)
        with self._lock:
            return control.fits(size, lossless=self._lossless, packet=passed_on)

    def may_reply(self, size: int) -> str:
        """Return why a compressed picture must not be a reply to a query now; empty if it may be.

        The bytes of the reply are charged to the budget. Called on any thread.
        """
        control = self._control
        if control is None:
            return ""
        with self._lock:
            wait_s = control.wait_to_reply(time.monotonic(), size)
        if not wait_s:
            return ""
        return f"max_kbps = {self._kbps} is used up by earlier replies; ask again in {wait_s:.1f} s"

    def _report(self, plan: Plan, control: RateControl, kbps: int, configured: int) -> str:
        passed_on = self._packet is not None and plan.untouched
        found = []
        if plan.quality < configured and not passed_on:
            found.append(f"quality {plan.quality} instead of {configured}")
        if plan.divisor > 1:
            found.append(PARTS[plan.divisor])
        if control.dropping:
            found.append("fewer frames")
        return f"max_kbps = {kbps}: {', '.join(found)}" if found else ""

    def _log_size(self, divisor: int) -> None:
        if divisor != self._divisor:
            log.info("max_kbps: pictures have %s from now on", PARTS[divisor])
            self._divisor = divisor


def reduced(picture: Picture, divisor: int) -> Picture:
    """Return a picture as pixels, with its sides divided, and its ground truth with them.

    Raises:
        PayloadError: ``corrupt``.
    """
    width, height = (max(1, round(side / divisor)) for side in (picture.width, picture.height))
    pixels = decoded(picture, picture.encoding, (width, height))
    if pixels.shape[:2] != (height, width):
        size = (width, height)
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)  # type: ignore[assignment]
    truth = picture.truth
    if truth is not None and divisor > 1:
        across, down = width / picture.width, height / picture.height
        truth = tuple(
            track.model_copy(
                update={
                    "x": track.x * across,
                    "y": track.y * down,
                    "box": (
                        round(track.box[0] * across),
                        round(track.box[1] * down),
                        max(1, round(track.box[2] * across)),
                        max(1, round(track.box[3] * down)),
                    ),
                    "area": track.area * across * down,
                    "vx": track.vx * across,
                    "vy": track.vy * down,
                }
            )
            for track in truth
        )
    return replace(
        picture, width=width, height=height, pixels=pixels, jpeg=None, stored=None, truth=truth
    )
