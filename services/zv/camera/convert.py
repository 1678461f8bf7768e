"""Makes the picture of a frame of a source's picture: flips, cuts out, converts or passes it on."""

from __future__ import annotations

from zenoh_vision.errors import ParameterRefused, PayloadError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.picture import JpegPicture, Picture, PixelPicture, check_size
from zv.camera.geometry import WHOLE, Geometry


def check_depth(delivered: str, wanted: str) -> None:
    """Check that pictures of one encoding can be published in another.

    Any picture can be converted, except that grey levels and colours are no distances.

    Raises:
        ParameterRefused: Depth is requested of pictures without depth.
    """
    if wanted in pixel_formats.DISTANCES and delivered not in pixel_formats.DEEP:
        others = [name for name in pixel_formats.ENCODINGS if name not in pixel_formats.DISTANCES]
        raise ParameterRefused(
            f"encoding = {wanted} is depth, but the source delivers {delivered}",
            f"{', '.join(others)}; depth only of grey pictures of 16 bits (PNG, TIFF, video) or "
            "of source = synthetic",
        )


class Converter:
    """Makes the pictures of one camera's frames."""

    def __init__(self) -> None:
        self._kind: tuple[object, ...] | None = None
        self._stays = False  # whether nothing of such pictures changes
        self._valid_epoch: int | None = None

    def picture(self, picture: Picture, geometry: Geometry, encoding: str, epoch: int) -> Picture:
        """Return the picture of a frame, in an encoding.

        A JPEG packet that needs no change is passed through unchanged, once a packet of its epoch
        has been decoded without a warning. Receivers refuse JPEGs with flaws, so if all packets
        of a source have flaws, they are decoded and encoded again.

        Raises:
            PayloadError: ``corrupt``, ``too_large``, ``region_outside``, or
                ``unsupported_encoding`` if depth is requested of a picture without depth.
        """
        kind = (picture.size, picture.encoding, geometry, encoding)
        if kind != self._kind:
            check_size(*picture.size)
            try:
                check_depth(picture.encoding, encoding)
            except ParameterRefused as refused:  # a folder may mix pictures of both kinds
                raise PayloadError("unsupported_encoding", refused.error) from None
            self._kind, self._stays = kind, geometry == WHOLE and picture.encoding == encoding
        shown = picture if self._stays else geometry.picture(picture, encoding)
        if isinstance(shown, JpegPicture) and not self._is_valid(shown.data, epoch):
            return PixelPicture(shown.pixels, encoding)
        return shown

    def _is_valid(self, jpeg: bytes, epoch: int) -> bool:
        """Tell whether this packet, or an earlier one of its epoch, decoded without a warning."""
        if self._valid_epoch != epoch:
            try:
                codecs.decode_jpeg(jpeg, "mono8")
            except PayloadError:
                return False
            self._valid_epoch = epoch
        return True
