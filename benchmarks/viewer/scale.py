"""The viewer with very many nodes: for how long its event loop stalls, and by its own work.

``python -m benchmarks.viewer.scale`` measures; its two other modes are the nodes and the pages, in
processes of their own.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import json
import time
from typing import Any

import aiohttp
import zenoh

from benchmarks.stream import percentiles
from benchmarks.system import System
from benchmarks.tools.exporter import report
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.messages import NodeDescription, Parameter, ParameterList
from zenoh_vision.node.node import Node
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.session import direct, open_session
from zv.viewer.http.access import Access
from zv.viewer.http.listener import listen
from zv.viewer.http.server import WebServer
from zv.viewer.settings import ViewerSettings

BEAT_S = 0.001
PARAMETERS = 20
TOPICS = ("image/compressed", "tracks")
MODULE = "benchmarks.viewer.scale"


def be_nodes(endpoint: str, number: int) -> None:
    """Be so many nodes, each with two streams, 20 parameters and a report a second."""
    session = open_session(Connection(connect=endpoint, timeout_s=20))
    names = [f"camera_c{index}" for index in range(number)]
    replies = {f"@vision/node/{name}": _description(name).to_bytes() for name in names}
    replies |= {f"@vision/param/{name}": _parameters(name).to_bytes() for name in names}
    reports = {f"@vision/diagnostics/{name}": report(name) for name in names}

    def answer(query: zenoh.Query) -> None:
        asked = str(query.key_expr)
        start = asked.removesuffix("*")
        for key in [asked] if asked in replies else replies:
            if key.startswith(start):
                query.reply(key, replies[key])

    kept = [
        session.declare_queryable(key, direct(answer))
        for key in ("@vision/node/*", "@vision/param/*")
    ]
    kept += [session.liveliness().declare_token(f"@vision/node/{name}") for name in names]
    while True:
        for key, payload in reports.items():
            session.put(key, payload)
            time.sleep(1 / number)


async def be_pages(address: str, number: int) -> None:
    """Open so many pages one after the other, and read all that they get."""

    async def read(http: aiohttp.ClientSession) -> None:
        async with http.ws_connect(address, max_msg_size=0) as socket:
            async for _ in socket:
                pass

    async with aiohttp.ClientSession() as http, asyncio.TaskGroup() as group:
        for _ in range(number):
            group.create_task(read(http))
            await asyncio.sleep(1)


def stalls(number: int, seconds: float) -> dict[str, Any]:
    """Longest stalls of the loop while nodes come, pages are opened, and all nodes go."""
    settings = ViewerSettings()
    parameters = ParameterStore(settings)
    found: dict[str, Any] = {"nodes": number, "streams": len(TOPICS) * number}
    gaps: list[tuple[float, float]] = []
    with System() as system:
        listening = listen("127.0.0.1", 0)
        address = f"http://127.0.0.1:{listening.getsockname()[1]}/live"
        connection = Connection(connect=system.endpoint)
        node = Node("viewer", camera=(), connection=connection, parameters=parameters)
        access = Access(None, frozenset({"localhost"}))
        gc.freeze()  # as ``zv view`` does before it starts
        with WebServer(listening, parameters, node, access) as server, node:
            server.connect(node.link)
            asyncio.run_coroutine_threadsafe(_beat(gaps), server._loop)
            for name, start, arguments in (
                ("idle", "", ()),
                ("nodes_come", "nodes", ("--nodes", f"{number}", "--at", system.endpoint)),
                ("pages_open", "pages", ("--pages", "5", "--at", address)),
            ):
                if start:
                    system.start(start, "-m", MODULE, *arguments)
                found[name] = _during(gaps, seconds)
                found[name]["streams"] = len(server._monitor.system.streams)
            system.processes.pop("nodes").kill()
            found["nodes_go"] = _during(gaps, seconds)
    return found


def _during(gaps: list[tuple[float, float]], seconds: float) -> dict[str, Any]:
    gaps.clear()
    time.sleep(seconds)
    return {
        name: percentiles(found)
        | {"max": round(max(found), 1), "over_50": sum(g > 50 for g in found)}
        for name, column in (("late_ms", 0), ("cpu_ms", 1))
        if (found := [1e3 * gap[column] for gap in list(gaps)])
    }


async def _beat(gaps: list[tuple[float, float]]) -> None:
    """Note how much later than asked the loop runs this, and the CPU time that its thread took."""
    while True:
        before_s, cpu_s = time.monotonic(), time.thread_time()
        await asyncio.sleep(BEAT_S)
        gaps.append((time.monotonic() - before_s - BEAT_S, time.thread_time() - cpu_s))


def _description(name: str) -> NodeDescription:
    camera = name.removeprefix("camera_")
    return NodeDescription(
        node=name,
        service="camera",
        cameras=(camera,),
        version="0",
        host="h",
        pid=1,
        started_ns=1,
        publishes=tuple(f"vision/{camera}/{topic}" for topic in TOPICS),
        subscribes=(f"vision/{camera}/image/compressed",),
        stamp_ns=time.time_ns(),
    )


def _parameters(name: str) -> ParameterList:
    found = [
        Parameter(
            node=name,
            name=f"parameter_{index}",
            type="float",
            value=1.0,
            default=2.0,
            minimum=0.0,
            maximum=10.0,
            description="as long as the descriptions of real parameters are",
        )
        for index in range(PARAMETERS)
    ]
    return ParameterList(node=name, revision=0, parameters=tuple(found))


def main() -> None:
    """Measure, or be the nodes or pages."""
    parser = argparse.ArgumentParser(prog=f"python -m {MODULE}", description=__doc__)
    parser.add_argument("--number", type=int, nargs="+", default=[100, 400, 1000])
    parser.add_argument("--seconds", type=float, default=15, help="of each phase")
    parser.add_argument("--nodes", type=int, default=0, help=argparse.SUPPRESS)
    parser.add_argument("--pages", type=int, default=0, help=argparse.SUPPRESS)
    parser.add_argument("--at", default="", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.nodes:
        be_nodes(options.at, options.nodes)
    elif options.pages:
        asyncio.run(be_pages(options.at, options.pages))
    else:
        for number in options.number:
            print(json.dumps(stalls(number, options.seconds), indent=2), flush=True)


if __name__ == "__main__":
    main()
