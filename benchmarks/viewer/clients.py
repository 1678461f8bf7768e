"""Measures the viewer's CPU for 1, 10 and 50 clients, compared with the naive server."""

from __future__ import annotations

import http.client
import socket
import sys
import threading
import time
from contextlib import ExitStack
from itertools import pairwise
from typing import Any, Self

from benchmarks.stream import percentiles
from benchmarks.system import System, free_endpoint
from tests.support.routing import port_answers

WIDTH, HEIGHT, RATE_HZ = 640, 480, 15.0
CLIENTS = (1, 10, 50)
QUERY = "/stream?topic=/front/image/compressed"
FORMS = {"original": "", "320x240": "&width=320&height=240"}


class Clients:
    """Clients that read a stream as fast as it arrives, in one thread, without decoding.

    Args:
        port: Port of the server.
        number: Number of clients.
        query: Path of the stream.
    """

    def __init__(self, port: int, number: int, query: str) -> None:
        self.received_bytes = 0
        self.pictures = 0
        self._sockets = [asked(port, query) for _ in range(number)]
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._read, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Disconnect all clients."""
        self._end.set()
        self._thread.join(5)
        for each in self._sockets:
            each.close()

    def _read(self) -> None:
        import selectors

        with selectors.DefaultSelector() as selector:
            for each in self._sockets:
                each.setblocking(False)
                selector.register(each, selectors.EVENT_READ)
            while not self._end.is_set():
                for key, _ in selector.select(0.1):
                    assert isinstance(key.fileobj, socket.socket)
                    data = key.fileobj.recv(1 << 18)
                    self.received_bytes += len(data)
                    self.pictures += data.count(b"Content-Length: ")


def asked(port: int, query: str) -> socket.socket:
    """Return a connection on which a stream was requested."""
    found = socket.create_connection(("127.0.0.1", port), 10)
    found.sendall(f"GET {query} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
    return found


def cpu_for_clients(seconds: float) -> dict[str, Any]:
    """CPU of the viewer and of the naive server, for each number of clients, in one run.

    Args:
        seconds: Of each measurement.
    """
    found: dict[str, Any] = {}
    with System() as system:
        ports = start(system)
        for form, more in FORMS.items():
            for number in CLIENTS:
                row: dict[str, Any] = {}
                for server, port in ports.items():
                    with Clients(port, number, QUERY + more) as clients:
                        wait_for(lambda clients=clients, number=number: clients.pictures > number)
                        pictures = clients.pictures
                        system.begin()
                        began_s = time.monotonic()
                        time.sleep(seconds)
                        elapsed_s = time.monotonic() - began_s
                        cpu = system.cpu_s()[server] / elapsed_s * 100
                        rate_hz = (clients.pictures - pictures) / elapsed_s / number
                    row[server] = {
                        "cpu_percent": round(cpu, 1),
                        "cpu_percent_per_client": round(cpu / number, 2),
                        "rate_hz_per_client": round(rate_hz, 2),
                    }
                row["naive_over_viewer"] = round(
                    row["naive"]["cpu_percent"] / max(0.1, row["viewer"]["cpu_percent"]), 1
                )
                found[f"{form}, {number} clients"] = row
    return found


def start(system: System) -> dict[str, int]:
    """Start a camera and both servers; return their ports."""
    shape = (f"{WIDTH}", f"{HEIGHT}", f"{RATE_HZ}")
    system.start("camera", "-m", "benchmarks.camera", *shape, system.endpoint)
    ports = {name: int(free_endpoint().rpartition(":")[2]) for name in ("viewer", "naive")}
    system.service("viewer", "view", "--port", f"{ports['viewer']}")
    system.start("naive", "-m", "benchmarks.viewer.naive", system.endpoint, f"{ports['naive']}")
    for port in ports.values():
        wait_for(lambda port=port: port_answers(port))
    wait_for(lambda: snapshot_status(ports["viewer"]) == 200)
    return ports


def ages(seconds: float, number: int = CLIENTS[-1]) -> dict[str, Any]:
    """Capture to arrival in one client of many, ms, as the parts' own stamps tell."""
    with System() as system:
        port = start(system)["viewer"]
        with Clients(port, number - 1, QUERY):
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
            connection.request("GET", QUERY)
            answer = connection.getresponse()
            found, numbers, end_s = [], [], time.monotonic() + seconds
            while time.monotonic() < end_s:
                head = {}
                while line := answer.readline().strip():
                    name, _, value = line.decode().partition(":")
                    head[name.lower()] = value.strip()
                if "content-length" in head:
                    answer.read(int(head["content-length"]))
                    found.append((time.time() - float(head["x-timestamp"])) * 1000)
                    numbers.append(int(head["x-seq"]))
            connection.close()
    skipped = sum(after - before - 1 for before, after in pairwise(numbers))
    return {"clients": number, "age_ms": percentiles(found), "skipped": skipped}


def memory(seconds: float) -> dict[str, Any]:
    """Memory of the viewer while clients come and go, MB; some of them never read."""
    with System() as system:
        port = start(system)["viewer"]
        samples = []
        end_s = time.monotonic() + seconds
        turns = 0
        while time.monotonic() < end_s:
            query = QUERY + list(FORMS.values())[turns % 2]
            with ExitStack() as stalled, Clients(port, 20, query):
                for _ in range(10):
                    stalled.enter_context(asked(port, query))
                time.sleep(1.0)
            turns += 1
            samples.append(system.memory_mb()["viewer"])
    third = max(1, len(samples) // 3)
    return {
        "clients": turns * 30,
        "mb_after_first_third": round(max(samples[:third]), 1),
        "mb_last_third": round(max(samples[-third:]), 1),
    }


def snapshot_status(port: int) -> int:
    """Return the status of a snapshot."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request("GET", QUERY.replace("stream", "snapshot"))
    status = connection.getresponse().status
    connection.close()
    return status


def wait_for(condition: Any, deadline_s: float = 20.0) -> None:
    """Wait until something holds."""
    end_s = time.monotonic() + deadline_s
    while not condition():
        if time.monotonic() > end_s:
            sys.exit("the system under test did not come up")
        time.sleep(0.05)
