"""The relay's loop."""

from __future__ import annotations

from functools import lru_cache

from zenoh_vision import Connection, Frame, Level, Node
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault
from zenoh_vision.config.revisions import Revision
from zenoh_vision.errors import ParameterRefused, PayloadError
from zenoh_vision.keys import JPEG
from zenoh_vision.messages import Header
from zenoh_vision.node.calibration_source import CalibrationSource
from zenoh_vision.topics import COMPRESSED, TOPICS, Topic
from zv.relay.settings import RELAYED, RelaySettings
from zv.relay.transform import RateLimit, Transform, Transformer, calibration_after

INFO = "camera_info"
USUAL_QUALITY = 80


def run(settings: RelaySettings, connection: Connection) -> None:
    """Publish pictures of a stream again, changed as the settings say, until told to stop.

    Raises:
        ConfigurationError: The stream is none of this namespace, or the relay's own.
    """
    camera, topic = settings.stream(connection.namespace)
    to = settings.to or camera
    is_camera = bool(settings.to)
    outputs = (COMPRESSED.name, INFO) if is_camera else (RELAYED,)
    with Node(
        "relay",
        name=settings.node_name,
        camera=list(dict.fromkeys((camera, to))),
        connection=connection,
        publishes={to: outputs} if to == camera else {camera: (), to: outputs},
        parameters=settings,
        counts=("received", "processed"),
    ) as node:
        source = TOPICS.get(topic, Topic(topic, JPEG))
        frames = node.frames(source, camera=camera, want=lambda _: None)
        relay = Relay(node, camera, to, is_camera=is_camera)
        for frame in frames:
            try:
                relay.take(frame)
            except PayloadError as error:
                node.counters.note(error.reason)
                node.health.log_drop(error)
            except ParameterRefused as refused:
                node.report("region", Level.WARN, str(refused))


@lru_cache(maxsize=1)
def scaled(calibration: Calibration, width: int, height: int) -> Calibration:
    """Return a calibration for frames of this size, computed once for all of them."""
    return calibration.scaled(width, height)


class Relay:
    """Publishes each frame in its new form: on a topic of its camera, or as another camera."""

    def __init__(self, node: Node, camera: str, to: str, *, is_camera: bool) -> None:
        self._node = node
        self._to = to
        self._is_camera = is_camera
        self._calibrations = CalibrationSource(node, camera)
        self._limit = RateLimit()
        self._transformer = Transformer()
        self._told: tuple[Calibration, Transform, int] | None = None

    def take(self, frame: Frame) -> None:
        """Publish a frame, unless it comes back, is over the rate or cannot be rectified.

        Raises:
            ParameterRefused: The region is not within the picture.
            PayloadError: The picture cannot be decoded.
        """
        origin = frame.header.origin or frame.header.camera
        if self._comes_back(origin):
            return
        revision: Revision[RelaySettings] = frame.revision
        settings = revision.settings
        if not self._limit.allow(frame.header, settings.rate):
            return
        known = self._calibration_of(frame.header)
        if settings.rectify and known is None:
            self._node.report("rectify", Level.WARN, "rectify: there is no camera_info that fits")
            return
        self._node.report("rectify", Level.OK)
        transform = Transform(known if settings.rectify else None, settings.box, settings.scale)
        picture, (width, height) = self._transformer.apply(frame, transform)
        self._node.report("region", Level.OK)
        quality = settings.quality or USUAL_QUALITY
        if settings.quality is not None and picture is frame.picture and not picture.is_deep:
            picture = picture.scaled(*picture.size)  # so that it is encoded again
        if not self._is_camera:
            self._node.publish_picture(RELAYED, picture, frame=frame, quality=quality)
            return
        header = frame.header.model_copy(
            update={
                "camera": self._to,
                "origin": origin,
                "width": width,
                "height": height,
                "encoding": picture.encoding,
                "node": self._node.name,
                "revision": revision.number,
                "assumed": None,
            }
        )
        result = Frame(header, picture, quality=quality)
        if known is not None:
            self._tell(result, known, transform)
        self._node.publish_picture(COMPRESSED, result)

    def _comes_back(self, origin: str) -> bool:
        """Tell, and report, whether relays have brought a frame back to its camera.

        Relays of one ``to`` have one name, so each camera has one relay at most: a circle that
        frames enter at a camera has come back to it when it closes.
        """
        if not self._is_camera or origin != self._to:
            self._node.report("circle", Level.OK)
            return False
        self._node.counters.note("relayed_back")
        self._node.report(
            "circle",
            Level.WARN,
            f"relays in a circle: these are pictures of {origin} itself, so nothing is published; "
            "end this relay, or give it --to with a new name",
        )
        return True

    def _calibration_of(self, header: Header) -> Calibration | None:
        """Return the calibration for frames of this size; None if there is none that fits."""
        known = self._calibrations.newest(header)
        try:
            fitting = known and scaled(known, header.width, header.height)
        except CalibrationFault as fault:
            self._node.report("calibration", Level.WARN, str(fault))
            return None
        self._node.report("calibration", Level.OK)
        return fitting

    def _tell(self, frame: Frame, known: Calibration, transform: Transform) -> None:
        """Publish the calibration of the result, once for each epoch and change."""
        told = (known, transform, frame.header.epoch)
        if told != self._told:
            self._told = told
            found = calibration_after(known, transform)
            self._node.publish(INFO, found.message(frame.header))
