"""The router's shell script in configs/compose/secure.yml, run without a container."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from contextlib import suppress
from pathlib import Path
from typing import Self

import yaml

from tests.support.processes import ROOT

SECURE = ROOT / "configs" / "compose" / "secure.yml"


class Entrypoint:
    """Runs it, with busybox as in the image of zenohd where that is installed.

    Args:
        rules: The file that is ``router.json5`` in the container.
        zenohd: The program that it starts.
        folder: Where its output goes.
        grace_s: How long a zenohd that was told to end has for it, instead of the script's 10.
        look_s: How often the rules are looked at, instead of each second.
    """

    def __init__(
        self,
        rules: Path,
        zenohd: str | Path,
        folder: Path,
        grace_s: int = 10,
        look_s: float = 0.2,
    ) -> None:
        self._log = folder / "entrypoint.log"
        script = yaml.safe_load(SECURE.read_text())["services"]["router"]["entrypoint"][2]
        for there, here in {
            "$$": "$",
            "/zenohd": str(zenohd),
            "/run/security/router.json5": str(rules),
            "/tmp/again": str(folder / "again"),
            "sleep 10": f"sleep {grace_s}",
            "while sleep 1;": f"while sleep {look_s};",
        }.items():
            assert there in script
            script = script.replace(there, here)
        shell = [each] if (each := shutil.which("busybox")) else []
        self._command = [*shell, "sh", "-c", script, "router", "-c", str(rules)]

    def __enter__(self) -> Self:
        with self._log.open("w") as log:
            self.process = subprocess.Popen(
                self._command, stdout=log, stderr=log, start_new_session=True
            )
        return self

    def __exit__(self, *error: object) -> None:
        if self.process.poll() is None:
            self.process.terminate()
        try:
            self.process.wait(20)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)  # what it waits with

    @property
    def said(self) -> str:
        return self._log.read_text()
