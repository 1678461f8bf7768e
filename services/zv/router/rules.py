"""The credentials and access rules of a router, which may be replaced while it runs."""

from __future__ import annotations

import logging
import time
from typing import Any, Final

from zenoh_vision.errors import ConfigurationError, VisionError
from zenoh_vision.security.credentials import credentials_file, file_state, read_json5
from zenoh_vision.transport.zenoh_config import router_config

log = logging.getLogger("router")

LOOK_S: Final = 1.0
"""How often the file is looked at."""

ANY: Final = "tcp/127.0.0.1:0"
"""An endpoint for a check: the file's own take precedence."""


class RouterRules:
    """Watches the file of ``zv security`` for a router.

    Args:
        credentials: The file, perhaps without its suffix.

    Attributes:
        fault: Why a changed file cannot be used; empty if it can. The former rules hold then.

    Raises:
        SourceError: There is no such file.
        ConfigurationError: It cannot be used, or others can read it.
    """

    def __init__(self, credentials: str) -> None:
        self.path = credentials_file(credentials)
        self.fault = ""
        self._check()
        self._taken = self._refused = file_state(self.path)
        self._look_s = 0.0

    def changed(self) -> bool:
        """Tell whether the file has changed, and can be used."""
        if time.monotonic() < self._look_s:
            return False
        self._look_s = time.monotonic() + LOOK_S
        state = file_state(self.path)
        if state == self._taken:
            self.fault, self._refused = "", state
        if state == self._refused:
            return False
        try:
            self._check()
        except VisionError as error:
            self.fault = f"the former rules hold: {error}"
            log.error("%s", self.fault)
            self._refused = state
            return False
        self._taken = self._refused = state
        self.fault = ""
        return True

    def _check(self) -> None:
        content: dict[str, Any] = read_json5(self.path)
        if not isinstance(content.get("access_control"), dict):
            raise ConfigurationError(
                f"{self.path}: no configuration of a router; allowed: DIR/router, which "
                "zv security init writes"
            )
        router_config(ANY, str(self.path))
