"""What holds up no router that closes, and what it leaves behind when it takes new rules."""

from __future__ import annotations

import struct
import subprocess
import sys

LINGERS = struct.pack("ii", 1, 10)
WITH_A_CONNECTION = f"""
import os, socket, struct
from zv.router.connections import close_without_waiting, cut_connections
listening = socket.create_server(("127.0.0.1", 0))
far = socket.create_connection(listening.getsockname())
own, _ = listening.accept()
own.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, {LINGERS!r})
"""


def run_with_a_connection(commands: str) -> str:
    """Run in a process of its own, whose connections are none of the tests'."""
    command = [sys.executable, "-c", WITH_A_CONNECTION + commands]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout


def test_a_connection_is_closed_without_waiting_for_who_does_not_read():
    printed = run_with_a_connection(
        "close_without_waiting()\n"
        "print(struct.unpack('ii', own.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8))[0])\n"
        "own.sendall(b'still there'); print(far.recv(100).decode())\n"
    )
    assert printed == "0\nstill there\n"


def test_every_connection_is_cut_and_the_listening_socket_is_left():
    printed = run_with_a_connection(
        "cut_connections()\n"
        "print(far.recv(100), own.recv(100))\n"
        "socket.create_connection(listening.getsockname(), timeout=5); print('listens')\n"
    )
    assert printed == "b'' b''\nlistens\n"


CLOSES = """
import contextlib, os, signal, socket
from types import SimpleNamespace
from zv.router import service
from zv.router.settings import RouterSettings
listening = socket.create_server(("127.0.0.1", 0))
connections = []

@contextlib.contextmanager
def first(*_):
    yield SimpleNamespace(zid=lambda: "ab", get=lambda *_, **__: [])
    # Somebody connects while the router closes: Zenoh has accepted it, and knows nothing of it.
    far = socket.create_connection(listening.getsockname(), timeout=5)
    connections.extend((far, listening.accept()[0]))

@contextlib.contextmanager
def second(*_):
    print(connections[0].recv(100))
    os.kill(os.getpid(), signal.SIGTERM)
    yield SimpleNamespace(zid=lambda: "cd", get=lambda *_, **__: [])

opened = [first, second]
service._opened = lambda *_: opened.pop(0)()
service.RouterRules = lambda *_: SimpleNamespace(
    config=None, fault="", path="router.json5", changed=lambda: len(opened) == 1
)
service.renewal_of = lambda path: None
service.run(RouterSettings(), credentials="router")
"""


def test_who_connects_while_a_router_closes_to_take_new_rules_is_cut_too():
    """Such a connection would stay with the former router, and with its rules."""
    assert run_with_a_connection(CLOSES).strip() == "b''"
