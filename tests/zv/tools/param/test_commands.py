"""The commands of ``zv param``, without a network."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace

from zenoh_vision.health.fleet import MAX_NODES
from zenoh_vision.transport.connection import Connection
from zv.tools.param import commands
from zv.tools.param.options import SetOptions
from zv.tools.shared.output import Output


def test_a_note_says_how_many_nodes_that_match_are_not_set(monkeypatch, capsys):
    names = [f"a{number}" for number in range(MAX_NODES + 2)]
    tokens = [SimpleNamespace(name=name) for name in [*names, "b"]]
    session = SimpleNamespace(namespace="vision", ask_all=lambda _: [tokens])
    done: list[str] = []
    monkeypatch.setattr(commands, "ToolSession", lambda _: nullcontext(session))
    monkeypatch.setattr(commands, "_set", lambda _, node, *rest, **more: done.append(node))
    commands.set_(SetOptions(node="a*", values=("low=1",)), Connection(), Output(as_json=False))
    assert done == sorted(names)[:MAX_NODES]
    assert "2 more nodes match and are left out" in capsys.readouterr().err
