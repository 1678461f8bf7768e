"""The controls of a device: exposure, gain, white balance, focus and all others that it has."""

from __future__ import annotations

import ctypes
import errno
import logging
import re
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from videodev2 import videodev2 as v4l2

from zenoh_vision.error_text import shortened, suggestion
from zenoh_vision.errors import ParameterRefused
from zenoh_vision.messages import Parameter
from zv.camera.sources.v4l2.driver import Driver, text_of

log = logging.getLogger(__name__)

Value = bool | int | str

TYPES: Final = {
    int(v4l2.V4L2_CTRL_TYPE_INTEGER): "int",
    int(v4l2.V4L2_CTRL_TYPE_INTEGER64): "int",
    int(v4l2.V4L2_CTRL_TYPE_BITMASK): "int",
    int(v4l2.V4L2_CTRL_TYPE_BOOLEAN): "bool",
    int(v4l2.V4L2_CTRL_TYPE_BUTTON): "bool",
    int(v4l2.V4L2_CTRL_TYPE_MENU): "str",
    int(v4l2.V4L2_CTRL_TYPE_INTEGER_MENU): "str",
    int(v4l2.V4L2_CTRL_TYPE_STRING): "str",
}
"""Types of controls that are parameters. A parameter is one value: no array and no structure."""

MENUS: Final = (int(v4l2.V4L2_CTRL_TYPE_MENU), int(v4l2.V4L2_CTRL_TYPE_INTEGER_MENU))
MASK: Final = int(v4l2.V4L2_CTRL_TYPE_BITMASK)
ALL_BITS: Final = 0xFFFFFFFF
WIDE: Final = (int(v4l2.V4L2_CTRL_TYPE_INTEGER64),)

FLAGS: Final = {
    "read_only": int(v4l2.V4L2_CTRL_FLAG_READ_ONLY),
    "write_only": int(v4l2.V4L2_CTRL_FLAG_WRITE_ONLY),
    "inactive": int(v4l2.V4L2_CTRL_FLAG_INACTIVE),
    "volatile": int(v4l2.V4L2_CTRL_FLAG_VOLATILE),
    "grabbed": int(v4l2.V4L2_CTRL_FLAG_GRABBED),
}
MEANING: Final = {
    "read_only": "only read",
    "write_only": "only set",
    "inactive": "without effect now, such as while it is automatic",
    "volatile": "changed by the device itself",
    "grabbed": "locked while the device delivers pictures",
}

NEXT: Final = int(v4l2.V4L2_CTRL_FLAG_NEXT_CTRL)
MOST: Final = 500
"""Controls after which a driver is not asked for more."""


@dataclass(frozen=True, slots=True)
class Control:
    """One control, as the driver describes it.

    Attributes:
        name: ``exposure_time_absolute``.
        title: ``Exposure Time, Absolute``.
        number: The driver's number of it.
        kind: The driver's number of its type.
        minimum: Smallest value; for a menu, the first entry's number; for a text, its length.
        maximum: Largest value; for a menu, the last entry's number; for a text, its length.
        step: Steps of the value.
        default: The driver's default.
        flags: Words of ``FLAGS``.
        menu: The entries of a menu, by number.
    """

    name: str
    title: str
    number: int
    kind: int
    minimum: int
    maximum: int
    step: int
    default: int
    flags: frozenset[str]
    menu: Mapping[int, str]

    @property
    def type(self) -> str:
        """Type of its value: ``bool``, ``int`` or ``str``."""
        return TYPES[self.kind]

    @property
    def is_button(self) -> bool:
        """Whether it does something when it is set, and has no value."""
        return self.kind == int(v4l2.V4L2_CTRL_TYPE_BUTTON)

    def shown(self, raw: int | str) -> Value:
        """Return the driver's value as it is reported."""
        if isinstance(raw, str):
            return raw
        if self.kind == MASK:
            return raw & ALL_BITS
        if self.kind in MENUS:
            return self.menu.get(raw, str(raw))
        return bool(raw) if self.type == "bool" else raw

    def raw(self, value: object) -> int | str:
        """Return a value as the driver takes it.

        Raises:
            ParameterRefused: It is not allowed.
        """
        if self.kind in MENUS:
            for number, label in self.menu.items():
                if value == label or (type(value) is int and value == number):
                    return number
        elif self.type == "bool":
            if isinstance(value, bool) and not (self.is_button and not value):
                return int(value)
        elif self.type == "str":
            if isinstance(value, str) and self.minimum <= len(value.encode()) <= self.maximum:
                return value
        elif type(value) is int and self.minimum <= value <= self.maximum:
            return value
        raise ParameterRefused(
            f"control.{self.name} = {shortened(value)} is not allowed", self.allowed
        )

    @property
    def allowed(self) -> str:
        """The values that can be set, in words."""
        if self.kind in MENUS:
            return f"one of {', '.join(self.menu.values())}"
        if self.type == "bool":
            return "true" if self.is_button else "true or false"
        if self.type == "str":
            return f"a text of {self.minimum} to {self.maximum} bytes"
        steps = f" in steps of {self.step}" if self.step > 1 else ""
        return f"a whole number from {self.minimum} to {self.maximum}{steps}"


class Controls:
    """The controls of an open device, as parameters ``control.NAME``; safe between threads.

    Attributes:
        table: Name of the setting that keeps the values.
    """

    table = "controls"

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self._lock = threading.RLock()
        self._told: Callable[[], None] | None = None
        self._by_name = _read_all(driver, {})

    def __iter__(self) -> Iterator[Control]:
        """Iterate over the controls, in the driver's order."""
        return iter(self._by_name.values())

    # As a group of parameters

    def parameters(self) -> list[Parameter]:
        """Return a description of each control with its present value; none once it is closed."""
        with self._lock:
            try:
                self._by_name = _read_all(self._driver, self._by_name)
            except OSError:  # the device is gone
                return []
            return [self._parameter(each) for each in self._by_name.values()]

    def set(self, values: Mapping[str, object]) -> dict[str, Value]:
        """Set controls, all or none; return those to set at the next opening: not the buttons.

        Args:
            values: By name, without ``control.``.

        Raises:
            ParameterRefused: A value is not allowed, or the driver refuses it.
        """
        with self._lock:
            raw = {name: self._settable(name).raw(value) for name, value in values.items()}
            before: dict[str, int | str] = {}
            for name in sorted(raw, key=self._order):
                control = self._named(name)
                present = self._value(control)
                if present is not None:
                    before[name] = present
                try:
                    self._write(control, raw[name])
                except OSError as error:
                    before.pop(name, None)
                    self._restore(before)
                    raise self._refused(control, values[name], error) from None
            return {
                name: self._named(name).shown(value)
                for name, value in raw.items()
                if not self._named(name).is_button
            }

    def apply(self, values: Mapping[str, Value]) -> Iterator[str]:
        """Set what can be set of the values of the settings; yield what cannot, and what differs.

        Switches go first, since an exposure time can be set only after its automatic is off.
        """
        done = {}
        for name in sorted(values, key=self._order):
            try:
                self.set({name: values[name]})
                done[name] = values[name]
            except ParameterRefused as refused:
                yield f"not set: {refused}"
        for name, value in done.items():
            control = self._named(name)
            present, wanted = self._value(control), control.shown(control.raw(value))
            now = wanted if present is None else control.shown(present)
            if now != wanted:
                yield f"control.{name} = {wanted} was set, and the driver made it {now}"

    def watch(self, told: Callable[[], None] | None) -> None:
        """Call a function after the device or another program has changed a control."""
        self._told = told
        if told is None:
            return
        for control in tuple(self):
            wanted = v4l2.v4l2_event_subscription()
            wanted.type, wanted.id = v4l2.V4L2_EVENT_CTRL, control.number
            try:
                self._driver.call(v4l2.VIDIOC_SUBSCRIBE_EVENT, wanted)
            except OSError:  # not every driver tells
                return

    def take_events(self) -> None:
        """Take what the driver tells of changes, and pass it on; on the reader's thread."""
        changed = False
        for _ in range(MOST):
            try:
                self._driver.call(v4l2.VIDIOC_DQEVENT, v4l2.v4l2_event())
            except OSError:
                break
            changed = True
        if changed and self._told is not None:
            self._told()

    # Inside

    def _parameter(self, control: Control) -> Parameter:
        numeric = control.type == "int"
        menu = control.kind in MENUS
        present = self._value(control)
        value = None if present is None else control.shown(present)
        words = [control.title, *(MEANING[flag] for flag in FLAGS if flag in control.flags)]
        words += ["true does it once"] if control.is_button else []
        return Parameter(
            node="",
            name=f"control.{control.name}",
            type=control.type,
            value=False if control.is_button else value,
            default=None if control.type == "str" and not menu else control.shown(control.default),
            minimum=control.minimum if numeric else None,
            maximum=control.maximum if numeric else None,
            choices=tuple(control.menu.values()) if menu else None,
            description="; ".join(words),
            step=float(control.step) if numeric and control.step > 1 else None,
            flags=tuple(flag for flag in FLAGS if flag in control.flags) or None,
        )

    def _named(self, name: str) -> Control:
        found = self._by_name.get(name)
        if found is None:
            hint = suggestion(name, self._by_name, before="; ")
            raise ParameterRefused(
                f"the device has no control {shortened(name)}{hint}", ", ".join(self._by_name)
            )
        return found

    def _order(self, name: str) -> int:
        """Return 0 for switches and menus, 1 for values."""
        control = self._by_name.get(name)
        return int(control is not None and control.type == "int")

    def _settable(self, name: str) -> Control:
        control = self._named(name)
        if "read_only" in control.flags:
            others = ", ".join(each.name for each in self if "read_only" not in each.flags)
            raise ParameterRefused(f"control.{name} can only be read", others)
        return control

    def _refused(self, control: Control, value: object, error: OSError) -> ParameterRefused:
        why = error.strerror or str(error)
        if error.errno == errno.EBUSY:
            why = "it is locked while the device delivers pictures, or by another program"
        elif error.errno in (errno.EACCES, errno.EIO) and "inactive" in control.flags:
            why = "it is without effect now, such as while it is automatic"
        return ParameterRefused(
            f"control.{control.name} = {shortened(value)} is refused by the driver ({why})",
            control.allowed,
        )

    def _restore(self, before: Mapping[str, int | str]) -> None:
        for name, value in before.items():
            try:
                self._write(self._named(name), value)
            except OSError as error:
                log.warning("control.%s could not be set back: %s", name, error)

    def _value(self, control: Control) -> int | str | None:
        """Return the driver's value of a control; None if it has none, or does not tell it."""
        if control.is_button or "write_only" in control.flags:
            return None
        item, text = v4l2.v4l2_ext_control(), None
        item.id = control.number
        if control.kind == int(v4l2.V4L2_CTRL_TYPE_STRING):
            item.size = control.maximum + 1
            text = ctypes.create_string_buffer(item.size)
            item.u.string = ctypes.cast(text, ctypes.c_char_p)
        try:
            self._call(v4l2.VIDIOC_G_EXT_CTRLS, item)
        except OSError as error:
            log.debug("control %s cannot be read: %s", control.name, error)
            return None
        if text is not None:
            return text.value.decode("utf-8", "replace")
        return int(item.u.value64 if control.kind in WIDE else item.u.value)

    def _write(self, control: Control, value: int | str) -> None:
        item = v4l2.v4l2_ext_control()
        item.id = control.number
        if isinstance(value, str):
            text = ctypes.create_string_buffer(value.encode())
            item.size, item.u.string = len(text), ctypes.cast(text, ctypes.c_char_p)
        elif control.kind in WIDE:
            item.u.value64 = value
        else:
            item.u.value = ctypes.c_int32(value).value  # a mask may have the highest bit
        self._call(v4l2.VIDIOC_S_EXT_CTRLS, item)

    def _call(self, request: int, item: Any) -> None:
        several = v4l2.v4l2_ext_controls()
        several.u.which, several.count = v4l2.V4L2_CTRL_WHICH_CUR_VAL, 1
        several.controls = ctypes.pointer(item)
        self._driver.call(request, several)


def _read_all(driver: Driver, before: Mapping[str, Control]) -> dict[str, Control]:
    """Return the controls of a device that can be parameters, by name, in the driver's order.

    Menus, which can have a hundred entries, are taken from those that were read before. A webcam
    that fails at one control still has those before it.

    Raises:
        OSError: The device is gone.
    """
    found: dict[str, Control] = {}
    asked: Any = v4l2.v4l2_query_ext_ctrl()
    asked.id = NEXT
    for _ in range(MOST):
        try:
            driver.call(v4l2.VIDIOC_QUERY_EXT_CTRL, asked)
        except OSError as error:
            if error.errno == errno.ENODEV:
                raise
            if error.errno not in (errno.EINVAL, errno.ENOTTY) and not before:
                last = f"after {next(reversed(found))}" if found else "at all"
                log.warning("the driver lists no controls %s: %s", last, error.strerror or error)
            break
        is_scalar = not asked.nr_of_dims and not asked.flags & v4l2.V4L2_CTRL_FLAG_DISABLED
        if is_scalar and int(asked.type) in TYPES:
            name = name_of(asked.name, asked.id, found)
            found[name] = _control(driver, name, asked, before.get(name))
        asked.id |= NEXT
    return found


def _control(driver: Driver, name: str, asked: Any, before: Control | None) -> Control:
    kind, low, high = int(asked.type), int(asked.minimum), int(asked.maximum)
    default = int(asked.default_value)
    if kind == MASK:
        low, high, default = 0, high & ALL_BITS, default & ALL_BITS
    return Control(
        name=name,
        title=text_of(asked.name),
        number=int(asked.id),
        kind=kind,
        minimum=low,
        maximum=high,
        step=int(asked.step),
        default=default,
        flags=frozenset(word for word, flag in FLAGS.items() if asked.flags & flag),
        menu=before.menu if before else dict(_menu(driver, asked)) if kind in MENUS else {},
    )


def _menu(driver: Driver, asked: Any) -> Iterator[tuple[int, str]]:
    """Yield the entries of a menu, each text once, as ``TEXT (NUMBER)`` if it occurs again."""
    item: Any = v4l2.v4l2_querymenu()
    item.id = asked.id
    seen = set()
    for index in range(int(asked.minimum), min(int(asked.maximum), MOST) + 1):
        item.index = index
        try:
            driver.call(v4l2.VIDIOC_QUERYMENU, item)
        except OSError:  # numbers may be left out
            continue
        is_text = int(asked.type) == int(v4l2.V4L2_CTRL_TYPE_MENU)
        label = text_of(item.u.name) if is_text else str(item.u.value)
        if label in seen:
            label = f"{label} ({index})"
        seen.add(label)
        yield index, label


def name_of(title: Any, number: int, taken: Mapping[str, Control]) -> str:
    """Return the name of a control as ``v4l2-ctl`` has it: ``exposure_time_absolute``."""
    name = re.sub(r"[^a-z0-9]+", "_", text_of(title).lower()).strip("_") or f"{number:x}"
    return f"{name}_{number:x}" if name in taken else name
