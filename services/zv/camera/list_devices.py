"""``zv camera --list``: prints the devices of this machine and what they offer."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator, Sequence

from zenoh_vision.config.constraints import limits, plain
from zenoh_vision.error_text import printable
from zenoh_vision.errors import ConfigurationError, ExpectationNotMet, SourceError
from zv.camera.list_options import ListOptions
from zv.camera.settings import CameraSettings
from zv.camera.sources.v4l2.listing import Listed, OfferedFormat, listed_devices


def run(_settings: CameraSettings, options: ListOptions) -> None:
    """Print the devices of this machine, as a table or as JSON, one object per line.

    Raises:
        ConfigurationError: ``--json`` without ``--list``.
        SourceError: This is no Linux.
        ExpectationNotMet: There is no device.
    """
    if not options.list_:
        raise ConfigurationError("--json belongs to --list; allowed: zv camera --list --json")
    if sys.platform != "linux":
        raise SourceError("devices are listed by Video4Linux, which only Linux has")
    count = 0
    for count, device in enumerate(listed_devices(), 1):
        if options.json_:
            print(json.dumps(device.to_map()), flush=True)
        else:
            print("\n".join([*([""] if count > 1 else []), *lines(device)]), flush=True)
    if not count:
        raise ExpectationNotMet("this machine has no video device (/dev/video*)")


def lines(device: Listed) -> Iterator[str]:
    """Yield a device as lines of text: its paths, its formats, its controls."""
    yield printable(f"{device.path}  {device.name}".rstrip())
    aliases = [each for each in (device.node, *device.other_paths) if each != device.path]
    if aliases:
        yield printable(f"  also {', '.join(aliases)}")
    if device.error:
        yield printable(f"  cannot be opened: {device.error}")
        return
    rows = [("format", "size", "rates"), *_offered(device.formats)]
    yield from _aligned(rows)
    unread = [each.offer.fourcc.strip() for each in device.formats if not each.usable]
    if unread:
        yield printable(f"  not read: {', '.join(unread)}")
    if device.controls:
        yield ""
        controls = [
            (
                one.name.partition(".")[2],
                "-" if one.value is None else plain(one.value),
                "-" if one.default is None else plain(one.default),
                limits(one),
                ", ".join(one.flags or ()),
            )
            for one in device.controls
        ]
        yield from _aligned([("control", "value", "default", "allowed", ""), *controls])
    if device.compound:
        forms = ", ".join(f"{name} ({form})" for name, form in device.compound)
        yield printable(f"  no parameters, since they are no single values: {forms}")


def _offered(formats: Iterable[OfferedFormat]) -> Iterator[tuple[str, str, str]]:
    """Yield a row for each size, once for all formats that offer the same sizes and rates."""
    same: dict[tuple[tuple[str, str], ...], list[str]] = {}
    for each in formats:
        if each.usable:
            sizes = tuple(zip(map(str, each.offer.sizes), map(str, each.rates), strict=True))
            same.setdefault(sizes or (("size not stated", ""),), []).append(each.offer.fourcc)
    for sizes, names in same.items():
        for index, (size, rates) in enumerate(sizes):
            yield (" ".join(map(str.strip, names)) if not index else "", size, rates)


def _aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield rows with their columns below each other; a long cell does not widen its column."""
    widest = [
        max((len(row[index]) for row in rows if len(row[index]) <= MOST), default=0)
        for index in range(len(rows[0]))
    ]
    for row in rows:
        cells = [cell.ljust(width) for cell, width in zip(row, widest, strict=True)]
        yield printable(f"  {'  '.join(cells)}".rstrip())


MOST = 40
