"""Loads whatever a command may need, in the server that processes are forked from."""

from __future__ import annotations

import gc
import importlib
import pkgutil

import tests.support.fork_server  # noqa: F401 - where a process begins
import zv

NAMES = [module.name for module in pkgutil.walk_packages(zv.__path__, "zv.")]
for name in (*NAMES, "av", "cv2", "rich.live", "rich.table"):
    if name != "zv.__main__":
        importlib.import_module(name)
gc.freeze()  # else each fork would copy all that a collection looks at
