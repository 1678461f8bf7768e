"""The devices of this machine: where they are, by names that stay the same, and what they offer."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

from zenoh_vision.host.video_devices import device_nodes, stable_paths
from zenoh_vision.messages import Parameter
from zv.camera.sources.v4l2.compound import compound_controls
from zv.camera.sources.v4l2.controls import Controls
from zv.camera.sources.v4l2.driver import Driver
from zv.camera.sources.v4l2.layouts import preference
from zv.camera.sources.v4l2.offers import Offer, Rates, offers_of, rates_of

NOTHING_TO_LIST: Final = (errno.ENOTTY, errno.EINVAL)


@dataclass(frozen=True, slots=True)
class OfferedFormat:
    """A format of a device.

    Attributes:
        offer: As the driver lists it.
        usable: Whether ``zv camera`` can read it.
        rates: Of each size of the offer; of a range, of the largest.
    """

    offer: Offer
    usable: bool
    rates: tuple[Rates, ...]


@dataclass(frozen=True, slots=True)
class Listed:
    """A device, or why it cannot be asked.

    Attributes:
        path: A path that stays the same when the device is plugged in again, if it has one.
        node: ``/dev/video0``.
        other_paths: Its other stable paths.
        compound: Its controls that are no parameters, since they are arrays or structures: the name
            of each and its form.
        error: Why it cannot be opened; empty if it can.
    """

    path: str
    node: str
    other_paths: tuple[str, ...]
    name: str = ""
    driver: str = ""
    bus: str = ""
    formats: tuple[OfferedFormat, ...] = ()
    controls: tuple[Parameter, ...] = ()
    compound: tuple[tuple[str, str], ...] = ()
    error: str = ""

    def to_map(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {
            "path": self.path,
            "node": self.node,
            "other_paths": list(self.other_paths),
            "name": self.name,
            "driver": self.driver,
            "bus": self.bus,
            "error": self.error or None,
            "formats": [_format_map(each) for each in self.formats],
            "controls": [_control_map(each) for each in self.controls],
            "compound": dict(self.compound),
        }


def listed_devices() -> Iterator[Listed]:
    """Yield the devices of this machine that deliver pictures, and those that cannot be opened."""
    for node in device_nodes():
        path, *others = [*stable_paths(node), str(node)]
        listed = Listed(path, str(node), tuple(others[:-1]))
        try:
            driver = Driver(str(node))
        except OSError as error:
            if error.errno not in NOTHING_TO_LIST:
                yield replace(listed, error=error.strerror or str(error))
            continue
        try:
            if driver.captures:
                yield replace(
                    listed,
                    name=driver.name,
                    driver=driver.driver,
                    bus=driver.bus,
                    formats=tuple(_formats(driver)),
                    controls=tuple(Controls(driver).parameters()),
                    compound=tuple(compound_controls(driver)),
                )
        except OSError as error:
            yield replace(listed, error=error.strerror or str(error))
        finally:
            driver.close()


def _formats(driver: Driver) -> Iterator[OfferedFormat]:
    for offer in offers_of(driver):
        largest = ((each.width[1], each.height[1]) for each in offer.sizes)
        rates = tuple(rates_of(driver, offer.fourcc, *size) for size in largest)
        yield OfferedFormat(offer, preference(offer.fourcc) >= 0, rates)


def _format_map(found: OfferedFormat) -> dict[str, Any]:
    return {
        "fourcc": found.offer.fourcc.strip(),
        "description": found.offer.description,
        "usable": found.usable,
        "sizes": [
            {
                **asdict(size),
                "rates_hz": list(rates.values),
                "any_rate_between": rates.between,
            }
            for size, rates in zip(found.offer.sizes, found.rates, strict=True)
        ],
    }


def _control_map(control: Parameter) -> Mapping[str, Any]:
    left_out = {"node", "revision"}
    return {name: value for name, value in control.to_map().items() if name not in left_out}


def holders(node: Path) -> list[str]:
    """Return the programs that have a device open, as far as this user may see: ``obs (12)``."""
    found = []
    target = os.path.realpath(node)
    for process in Path("/proc").glob("[0-9]*"):
        if process.name == str(os.getpid()):
            continue
        try:
            files = [os.path.realpath(each) for each in (process / "fd").iterdir()]
            name = (process / "comm").read_text().strip()
        except OSError:
            continue
        if target in files:
            found.append(f"{name} ({process.name})")
    return found
