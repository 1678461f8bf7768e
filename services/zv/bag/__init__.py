"""Recordings: MCAP files that keep what was on the network as it was, and open in other programs.

The layout of a file, by the words of the MCAP specification:

- A **channel** for each key and form of payload; its topic is the key. The metadata of a channel
  say ``zenoh_vision``: what its messages are, of which there are three kinds.
- ``sample.v1``: samples as they arrived. A message is protobuf: the payload is one field of it,
  byte by byte, and fields from 100 on hold the Zenoh encoding, attachment, time stamp and kind. The
  schema of compressed pictures is ``foxglove.CompressedImage`` with those fields added, that of raw
  pixels ``foxglove.RawImage``; so programs that know Foxglove's schemas show the pictures, and the
  bytes remain the camera's. Everything else is ``zenoh_vision.Sample``.
- ``derived.v1``: what other programs need beside that, made of the samples: boxes as
  ``foxglove.ImageAnnotations``, calibrations as ``foxglove.CameraCalibration``. Not replayed.
- ``account.v1``: JSON, once a minute and at the end: for each key what was taken and what was
  missed, with the reason.

``log_time`` is the time of arrival by a clock that does not go back within a file: the wall clock
when the file was begun, moved on by the monotonic clock. ``publish_time`` is the capture time in
the header, else Zenoh's time stamp, else the time of arrival. ``sequence`` is the frame's ``seq``.

Chunks are not compressed, since JPEG does not become smaller. A chunk is closed after a fraction of
a second, has a CRC, and contains the schemas and channels of its messages, so each can be read
without the rest of the file. While a file is written its name ends in ``.partial``; it gets its
name when it is complete with summary and index.

``Recording`` reads a file, whole or cut; ``Writer`` writes one.
"""
