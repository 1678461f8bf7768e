"""Identifies, publishes and counts the frames of a node that is a camera."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from zenoh_vision.config.revisions import ParameterStore, Revision
from zenoh_vision.errors import PayloadError
from zenoh_vision.health.health import Health
from zenoh_vision.image import codecs
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.pixel_formats import (
    MAX_PIXELS,
    MAX_SIDE,
    Pixels,
    encoding_named,
    encoding_of,
)
from zenoh_vision.messages import Header
from zenoh_vision.node.outputs import Outputs
from zenoh_vision.stream.counters import FrameCounters

QUALITY = 80


class Owner(Protocol):
    """The part of a node that its own frames use."""

    name: str
    outputs: Outputs
    counters: FrameCounters
    health: Health
    inputs: set[Any]
    parameters: ParameterStore[Any] | None

    def drop(self, error: PayloadError) -> None:
        """Count one pending frame as dropped, and log it."""


class OwnFrames:
    """Turns the pictures of a node's cameras into published frames; called by one thread.

    Args:
        node: Publishes and counts them.
        camera: Returns the camera that an argument selects; ValueError if the node does not serve
            it.
    """

    def __init__(self, node: Owner, camera: Callable[[str | None], str]) -> None:
        self._node = node
        self._camera = camera
        self._last: dict[str, tuple[int, int]] = {}  # epoch and seq of each camera

    def publish_captured(
        self,
        picture: Pixels | bytes,
        *,
        camera: str | None = None,
        encoding: str | None = None,
        quality: int = QUALITY,
        stamp_ns: int | None = None,
        new_epoch: bool = False,
    ) -> Frame | None:
        """Publish a picture as the next frame of a camera of this node, and count it.

        It counts as ``captured``, and then as ``published`` or dropped: as ``no_subscriber``, or
        under the name of what is wrong with the picture. The newest parameters are activated for
        the next picture.

        Args:
            picture: (height, width[, channels]) uint8 or uint16, or the bytes of a JPEG or PNG,
                which are published as they are.
            camera: Which one, if the node has several.
            encoding: ``bgr8``, ``mono8``, ...; by default that of the channels and dtype, with
                colour in the order B, G, R; of a JPEG or PNG ``bgr8``, or ``mono16`` if it is grey
                with 16 bits.
            quality: JPEG quality, 1 to 100, unless the node has a setting ``quality``, which then
                holds instead.
            stamp_ns: Time of capture since 1970; by default now.
            new_epoch: The source was opened again, so its numbers begin again.

        Returns:
            The frame, from which other results can be made; None if the picture was dropped.
        """
        node = self._node
        camera = self._camera(camera)
        node.outputs.check_camera(camera)
        node.health.loop_alive()
        node.counters.arrive()
        stamp_ns = time.time_ns() if stamp_ns is None else stamp_ns
        revision = None if node.parameters is None else node.parameters.active
        epoch, seq = self._last.get(camera, (0, 0))
        started = new_epoch or not epoch
        epoch, seq = (time.time_ns(), 0) if started else (epoch, seq + 1)
        self._last[camera] = (epoch, seq)
        try:
            width, height, named = _checked(picture, encoding)
            header = Header(
                camera=camera,
                epoch=epoch,
                seq=seq,
                stamp_ns=stamp_ns,
                width=width,
                height=height,
                encoding=named,
                node=node.name,
                revision=0 if revision is None else revision.number,
            )
            frame = _frame(header, picture, quality, revision)
            self._publish(frame, lambda _: True)
        except PayloadError as error:
            node.drop(error)
            return None
        finally:
            if node.parameters is not None:
                node.parameters.activate()
        return frame

    def publish_frame(self, frame: Frame) -> bool:
        """Publish a frame that was made elsewhere; see ``Node.publish_frame``."""
        node = self._node
        if node.inputs:
            return node.outputs.publish_frame(frame, not_decoded=self._not_decoded)
        node.outputs.check_camera(frame.header.camera)
        node.health.loop_alive()
        node.counters.arrive()
        subscribed = self.publish_pending(frame)
        if node.parameters is not None:
            node.parameters.activate()
        return subscribed

    def publish_pending(
        self, frame: Frame, may_send: Callable[[Frame], bool] = lambda _: True
    ) -> bool:
        """Publish a frame that was counted as captured, and count it as published or dropped.

        Args:
            frame: The frame.
            may_send: Tells whether the budget of bandwidth allows to send it compressed; called
                only if someone subscribes to that. A frame that nobody gets for that reason is
                dropped as ``over_budget``.

        Returns:
            Whether it was sent to someone.
        """
        try:
            return self._publish(frame, may_send)
        except PayloadError as error:
            self._node.drop(error)
            return False

    def _publish(self, frame: Frame, may_send: Callable[[Frame], bool]) -> bool:
        """Publish and count a frame, unless it can neither be encoded nor decoded.

        Raises:
            PayloadError: It cannot; it is not counted yet.
        """
        node = self._node
        withheld = False

        def allowed(frame: Frame) -> bool:
            nonlocal withheld
            withheld = not may_send(frame)
            return not withheld

        subscribed = node.outputs.publish_frame(frame, allowed, not_decoded=self._not_decoded)
        if subscribed:
            node.counters.finish()
        elif withheld:
            node.counters.drop("over_budget")
        else:
            node.counters.drop("no_subscriber")
        node.health.done(frame.header.stamp_ns)
        return subscribed

    def _not_decoded(self, error: PayloadError) -> None:
        """Count and log a frame that was sent compressed, but not as pixels."""
        self._node.counters.note("not_decoded")
        self._node.health.log_drop(error)


def _checked(picture: Pixels | bytes, encoding: str | None) -> tuple[int, int, str]:
    """Return width, height and encoding of a picture.

    Raises:
        PayloadError: It is no picture, or not in the encoding that is given.
    """
    if isinstance(picture, bytes):
        named = encoding or codecs.stored_encoding(picture)
        encoding_named(named)
        return *codecs.picture_size(picture), named
    if not isinstance(picture, np.ndarray) or picture.ndim not in (2, 3):
        found = getattr(picture, "shape", type(picture).__name__)
        raise PayloadError(
            "unsupported_encoding",
            f"{found} instead of an array (height, width[, channels]) or the bytes of a picture",
        )
    named = encoding or encoding_of(picture)
    known = encoding_named(named)
    channels = 1 if picture.ndim == 2 else picture.shape[2]
    if (channels, picture.dtype) != (known.channels, known.dtype):
        raise PayloadError(
            "unsupported_encoding",
            f"{channels} channels of {picture.dtype} are not {named}, which has {known.channels} "
            f"of {known.dtype}",
        )
    height, width = picture.shape[:2]
    if not 0 < width * height <= MAX_PIXELS:
        raise PayloadError("too_large", f"{width}x{height} pixels, at most {MAX_PIXELS} in all")
    if max(width, height) > MAX_SIDE:
        raise PayloadError("too_large", f"{width}x{height} pixels, a side at most {MAX_SIDE}")
    return width, height, named


def _frame(
    header: Header, picture: Pixels | bytes, quality: int, revision: Revision[Any] | None
) -> Frame:
    if isinstance(picture, bytes):
        frame = Frame(header, compressed=picture)
    else:
        if revision is not None:
            quality = getattr(revision.settings, "quality", quality)
        frame = Frame(header, pixels=picture, quality=quality)
    frame.revision = revision
    return frame
