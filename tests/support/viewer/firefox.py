"""A headless Firefox and one page in it, by WebDriver BiDi, its own remote protocol."""

from __future__ import annotations

import asyncio
import json
import shutil
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import aiohttp

from tests.support.processes import START_S, STOP_S, missing

LISTENS = "WebDriver BiDi listening on "
PATIENCE_S = 40.0
POLL_S = 0.1


@dataclass
class FirefoxPage:
    """One page, with what its console complained of."""

    socket: aiohttp.ClientWebSocketResponse
    context: str = ""
    complaints: list[str] = field(default_factory=list)
    asked: int = 0

    async def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command and return its result; events before it are taken."""
        self.asked += 1
        await self.socket.send_json({"id": self.asked, "method": method, "params": parameters})
        while True:
            said = await self.socket.receive_json(timeout=PATIENCE_S)
            if said.get("method") == "log.entryAdded" and said["params"]["level"] != "info":
                self.complaints.append(str(said["params"]["text"]))
            elif said.get("id") == self.asked:
                assert said["type"] == "success", said
                result: dict[str, Any] = said["result"]
                return result

    async def begin(self) -> None:
        await self.call("session.new", capabilities={})
        await self.call("session.subscribe", events=["log.entryAdded"])
        tree = await self.call("browsingContext.getTree")
        self.context = tree["contexts"][0]["context"]

    async def open(self, address: str) -> None:
        await self.call(
            "browsingContext.navigate", context=self.context, url=address, wait="complete"
        )

    async def evaluate(self, expression: str) -> Any:
        """Return the value of an expression, as JSON has it."""
        found = await self.call(
            "script.evaluate",
            expression=f"JSON.stringify({expression} ?? null)",
            target={"context": self.context},
            awaitPromise=True,
        )
        assert found["type"] == "success", found
        return json.loads(found["result"]["value"])

    async def wait(self, expression: str) -> Any:
        """Return an expression's first true value."""
        until_s = time.monotonic() + PATIENCE_S
        while not (found := await self.evaluate(expression)):
            assert time.monotonic() < until_s, (
                expression,
                await self.evaluate("document.body.innerText"),
                self.complaints,
            )
            await asyncio.sleep(POLL_S)
        return found

    async def press(self, key: str) -> None:
        """Press a key and let it go."""
        actions = [{"type": kind, "value": key} for kind in ("keyDown", "keyUp")]
        source = {"type": "key", "id": "keyboard", "actions": actions}
        await self.call("input.performActions", context=self.context, actions=[source])

    async def click(self, x: int, y: int) -> None:
        """Click at a point of the page."""
        press, release = ({"type": f"pointer{how}", "button": 0} for how in ("Down", "Up"))
        actions = [{"type": "pointerMove", "x": x, "y": y}, press, release]
        source = {"type": "pointer", "id": "mouse", "actions": actions}
        await self.call("input.performActions", context=self.context, actions=[source])


@asynccontextmanager
async def firefox_page(folder: Path) -> AsyncIterator[FirefoxPage]:
    """Run Firefox with a profile of its own; skip the test where there is none."""
    program = shutil.which("firefox-esr") or shutil.which("firefox")
    if program is None:
        missing("no firefox; Debian package firefox-esr")
    command = [program, "--headless", "--remote-debugging-port", "0", "--profile", str(folder)]
    process = await asyncio.create_subprocess_exec(
        *command,
        env={"HOME": str(folder), "PATH": "/usr/bin:/bin"},
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        address = await asyncio.wait_for(_address(process), START_S)
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{address}/session", max_msg_size=0) as socket,
        ):
            page = FirefoxPage(socket)
            await page.begin()
            yield page
    finally:
        if process.returncode is None:
            process.terminate()
        await asyncio.wait_for(process.wait(), STOP_S)


async def _address(process: asyncio.subprocess.Process) -> str:
    """Return where Firefox listens, which it prints."""
    assert process.stderr is not None
    async for line in process.stderr:
        _, found, address = line.decode(errors="replace").partition(LISTENS)
        if found:
            return address.strip()
    raise AssertionError(f"firefox ended with status {process.returncode}")
