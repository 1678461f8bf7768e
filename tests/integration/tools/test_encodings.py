"""Text that the encoding of the output lacks: it is escaped, and no command fails because of it."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.support.listening import open_client
from tests.support.processes import START_S, environment
from tests.support.standing_in import StandIn

NAME = "cam→Ω 北"
NODE = "tracker_front"
KEY = f"vision/front/{NAME}"


@pytest.fixture(scope="module")
def foreign(endpoint: str):
    """A node that says in its description, its health and a message what Latin-1 lacks."""
    with open_client(endpoint) as session:
        node = StandIn(
            session,
            NODE,
            second_s=0.05,
            health={"level": 2, "message": NAME},
            service="tracker",
            host=NAME,
            publishes=[KEY],
        )
        reply = session.declare_queryable(KEY, lambda query: query.reply(KEY, NAME))
        yield
        reply.undeclare()
        del node


@pytest.mark.usefixtures("foreign")
@pytest.mark.parametrize(
    "words",
    [
        "top --once",
        "topic echo vision/front/* --once",
        "topic hz vision/Ω --for 0.1 --timeout 0.5",  # on standard error
    ],
)
def test_what_the_output_cannot_encode_is_escaped(endpoint: str, words: str):
    done = subprocess.run(
        [sys.executable, "-m", "zv", *words.split(), "--connect", endpoint],
        env=environment() | {"PYTHONIOENCODING": "latin-1", "PATH": os.environ["PATH"]},
        capture_output=True,
        timeout=START_S,
        check=False,
    )
    said = (done.stdout + done.stderr).decode("latin-1")
    assert done.returncode in (0, 1), said
    assert "\\u03a9" in said
