"""The log of who changed which parameter: lines, steps, limits, and pages that leave at once."""

import asyncio
import math
import time
from types import SimpleNamespace

import pytest

from zenoh_vision.errors import ParameterRefused
from zenoh_vision.messages import Parameter
from zv.viewer.credentials import Principal, Scope
from zv.viewer.websocket.audit import MAX_LINES, MAX_REFUSED, ParameterAudit
from zv.viewer.websocket.commands import SetParameters
from zv.viewer.websocket.session import WebSocketSession

WHO = "192.0.2.1, session 1a2b3c4d (control)"
LOW = Parameter(node="edge_front", name="low", type="float", value=40.0, default=40.0, revision=0)


@pytest.fixture
def audit(caplog) -> ParameterAudit:
    caplog.set_level("INFO", "viewer")
    return ParameterAudit()


@pytest.fixture
def lines(audit, caplog):
    """What is logged, once it is flushed."""

    def flushed() -> list[str]:
        audit.flush()
        return caplog.messages

    return flushed


def note(audit, values, accepted=True, who=WHO):
    outcome = "accepted (revision 1)" if accepted else "not accepted: no"
    audit.note(who, "edge_front", {"low": LOW}, values, outcome, refused=not accepted)


async def test_each_parameter_is_a_line_with_client_name_old_and_new_value(audit, lines):
    note(audit, {"low": 41, "new": None})
    assert lines() == [
        f"{WHO} set low of edge_front from 40.0 to 41: accepted (revision 1)",
        f"{WHO} set new of edge_front from unknown to None: accepted (revision 1)",
    ]


async def test_steps_are_one_line_from_the_first_value_to_the_last(audit, lines):
    for value in range(41, 91):
        note(audit, {"low": value})
    note(audit, {"low": 1e9}, accepted=False)
    note(audit, {"low": 5}, who="another")
    assert lines() == [
        f"{WHO} set low of edge_front from 40.0 to 90 in 50 steps: accepted (revision 1)",
        f"{WHO} set low of edge_front from 40.0 to 1000000000.0: not accepted: no",
        "another set low of edge_front from 40.0 to 5: accepted (revision 1)",
    ]


async def test_of_a_flood_a_limited_number_of_lines_and_the_number_of_others_are_logged(
    audit, lines
):
    for number in range(MAX_LINES + 400):
        note(audit, {f"p{number}": "x" * 10_000})
    found = lines()
    assert len(found) == MAX_LINES + 1
    assert found[-1] == "400 more changes of parameters were not logged"
    assert max(map(len, found)) < 300


async def test_refused_changes_displace_no_accepted_one_and_few_refused_ones_of_others(
    audit, lines
):
    for client in range(2 * MAX_LINES):
        note(audit, {f"p{number}": 1 for number in range(100)}, False, f"client {client}")
    note(audit, {"low": 41})
    found = lines()
    assert len(found) == MAX_LINES + 2
    assert [line for line in found if line.startswith("client 3 ")] == [
        f"client 3 set p{number} of edge_front from unknown to 1: not accepted: no"
        for number in range(MAX_REFUSED)
    ]
    assert found[-2] == f"{WHO} set low of edge_front from 40.0 to 41: accepted (revision 1)"
    left_out = 2 * MAX_LINES * 100 - MAX_LINES
    assert found[-1] == f"{left_out} more refused changes of parameters were not logged"


async def test_an_invalid_name_is_quoted_and_shortened(audit, lines):
    note(audit, {"low of edge_front from 1 to 2: accepted\n": 1, "n" * 5000: 1})
    first, second = lines()
    assert r"set 'low of edge_front from 1 to 2: accepted\n' of edge_front" in first
    assert len(second) < 300


async def test_a_line_is_logged_without_another_change(caplog):
    audit = ParameterAudit()
    with caplog.at_level("INFO", "viewer"):
        note(audit, {"low": 41})
        while not caplog.messages:
            await asyncio.sleep(0.01)
    assert len(caplog.messages) == 1


class SilentMonitor:
    """A node that is asked and never answers."""

    def __init__(self) -> None:
        node = SimpleNamespace(parameters={"low": LOW})
        self.system = SimpleNamespace(fleet=SimpleNamespace(node=lambda _: node))
        self.asked = asyncio.Event()

    async def set(self, *_):
        self.asked.set()
        await asyncio.wait_for(asyncio.Event().wait(), 30)


def session_of(
    monitor, audit, scope=Scope.CONTROL, end_s=math.inf, headers=None
) -> WebSocketSession:
    request = SimpleNamespace(headers=headers or {}, query={}, remote="192.0.2.1")
    principal = Principal(scope, f"session 1a2b3c4d ({scope})", end_s)
    given = None, request, None, monitor, principal, audit
    return WebSocketSession(*given)  # type: ignore[arg-type]


SET = SetParameters(op="set", id=1, node="edge_front", values={"low": 41})


async def test_a_page_that_leaves_before_the_answer_is_logged(audit, lines):
    monitor = SilentMonitor()
    asking = asyncio.create_task(session_of(monitor, audit)._set(SET))
    await monitor.asked.wait()
    asking.cancel()
    await asyncio.wait([asking])
    (line,) = lines()
    assert line.startswith(f"{WHO} set low of edge_front from 40.0 to 41: ")
    assert line.endswith("the page was gone before an answer")


async def test_a_page_that_leaves_hides_neither_this_change_nor_others(audit, lines):
    """Set what there is not, then what there is, and leave at once: the node may have accepted."""

    monitor = SilentMonitor()
    session = session_of(monitor, audit)
    for values in ({f"p{number}": 1 for number in range(2 * MAX_LINES)}, {"low": 41}):
        monitor.asked.clear()
        command = SET.model_copy(update={"values": values})
        asking = asyncio.create_task(session._set(command))
        await monitor.asked.wait()
        asking.cancel()
        await asyncio.wait([asking])
    note(audit, {"low": 42}, who="another")
    found = lines()
    assert len(found) == MAX_REFUSED + 3
    assert f"{WHO} set low of edge_front from 40.0 to 41: the page was gone" in found[-3]
    assert found[-2].startswith("another set low")


async def test_a_page_for_viewing_never_asks_the_node_and_is_one_line_without_its_names(
    audit, lines
):
    monitor = SilentMonitor()
    with pytest.raises(ParameterRefused, match="the scope control is missing"):
        await session_of(monitor, audit, Scope.VIEW)._set(SET)
    assert not monitor.asked.is_set()
    assert lines() == [
        "192.0.2.1, session 1a2b3c4d (view) set parameters of edge_front: "
        "not accepted: the scope control is missing: this page has the scope view"
    ]


async def test_a_page_whose_session_has_ended_never_asks_the_node(audit, lines):
    monitor = SilentMonitor()
    with pytest.raises(ParameterRefused, match="the session has ended"):
        await session_of(monitor, audit, end_s=time.time())._set(SET)
    assert not monitor.asked.is_set()
    assert lines() == [f"{WHO} set parameters of edge_front: not accepted: the session has ended"]


@pytest.mark.parametrize(
    ("sent", "logged"),
    [
        ("203.0.113.9, 2001:DB8::1", "203.0.113.9, 2001:DB8::1"),
        ("9.9.9.9, session 1a2b (control)", "'9.9.9.9, session 1a2b (control)'"),
        ("9.9.9.9', session 1a2b", '"9.9.9.9\', session 1a2b"'),
        ("1" * 5000, f"'{'1' * 60}'... (5000 characters)"),
    ],
)
async def test_what_a_client_says_of_its_address_is_quoted_unless_it_is_one(
    audit, lines, sent, logged
):
    session = session_of(None, audit, Scope.VIEW, headers={"X-Forwarded-For": sent})
    with pytest.raises(ParameterRefused):
        await session._set(SET)
    (line,) = lines()
    assert line.startswith(f"192.0.2.1 for {logged}, session 1a2b3c4d (view) set parameters of ")
