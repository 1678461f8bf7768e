"""``zv param`` as one types it, at a camera and a tracker that run."""

from __future__ import annotations

import json
import subprocess
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgpack
import pytest
import zenoh

from tests.integration.conftest import a_router, some_services
from tests.support.listening import ask, open_client, wait_for_nodes
from tests.support.processes import ROOT
from tests.support.typist import type_zv

CAMERA = ("camera", "--width", 64, "--height", 48, "--rate", 10)


@dataclass
class System:
    """A camera and a tracker, and what ``zv param`` says of them."""

    endpoint: str
    client: zenoh.Session

    def zv(self, *arguments: object, folder: Path = ROOT) -> subprocess.CompletedProcess[str]:
        """Run ``zv param`` with these arguments."""
        return type_zv(["param", *arguments], folder=folder, ZV_CONNECT=self.endpoint)

    def told(self, *arguments: object) -> str:
        """Return what a run that succeeds prints."""
        done = self.zv(*arguments)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def value(self, node: str, name: str) -> object:
        """Return a value, without the tool."""
        return ask(self.client, f"@vision/param/{node}/{name}")[0].body["value"]

    def put_back(self, node: str, **values: object) -> None:
        """Set values, without the tool."""
        (reply,) = self.client.get(f"@vision/set/{node}", payload=msgpack.packb(values))
        assert reply.ok


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Iterator[System]:
    folder = tmp_path_factory.mktemp("param")
    with (
        a_router(folder) as router,
        some_services(router.endpoint, folder) as start,
        open_client(router.endpoint) as client,
    ):
        start(*CAMERA)
        start("tracker")
        wait_for_nodes(client, "camera_front", "tracker_front")
        yield System(router.endpoint, client)


def test_list_shows_every_parameter_of_every_node_with_value_unit_and_range(system):
    rows = [" ".join(line.split()) for line in system.told("list").splitlines()]
    assert "tracker_front closing 20 20 pixels 0 to 255" in rows
    assert "camera_front rate 10.0 - Hz 0.0001 to 1000, or not set" in rows
    assert "camera_front flip none none none, horizontal, vertical, both" in rows
    only = system.told("list", "tracker_front")
    assert "camera_front" not in only
    assert only.splitlines()[1:-1] != []


def test_list_as_json_is_one_parameter_a_line_as_it_is_on_the_wire(system):
    rows = [json.loads(line) for line in system.told("list", "--json").splitlines()]
    assert {row["node"] for row in rows} == {"camera_front", "tracker_front"}
    (found,) = [row for row in rows if row["name"] == "closing"]
    on_the_wire = ask(system.client, "@vision/param/tracker_front/closing")[0].body
    assert {**found, "revision": 0} == {**on_the_wire, "revision": 0}


def test_get_prints_one_value_alone_and_several_with_their_names(system):
    assert system.told("get", "tracker_front", "closing") == "20\n"
    assert system.told("get", "camera_front", "flip", "fourcc", "loop") == (
        'flip = "none"\n# fourcc =\nloop = false\n'
    )
    assert json.loads(system.told("get", "camera_front", "rate", "--json"))["value"] == 10.0


def test_describe_says_what_it_is_for(system):
    said = system.told("describe", "tracker_front", "closing").splitlines()
    assert said[0] == "closing = 20"
    assert "closing kernel" in said[1]
    assert said[2].strip() == "int; 0 to 255; pixels; default 20"


def test_set_sets_several_and_says_what_has_changed(system):
    done = system.zv("set", "camera_front", "quality=61", "flip=both", "loop=no", "rate=")
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.splitlines()) == {
        "quality: 80 -> 61",
        "flip: none -> both",
        "rate: 10.0 -> not set",
    }
    assert "1 value unchanged" in done.stderr
    assert system.value("camera_front", "quality") == 61
    rows = [
        json.loads(line)
        for line in system.told(
            "set", "camera_front", "rate=10", "quality=80", "--json"
        ).splitlines()
    ]
    assert {row["name"]: row["value"] for row in rows} == {"rate": 10.0, "quality": 80}
    system.put_back("camera_front", flip="none")


def test_what_a_refusal_says_is_allowed_is_allowed(system):
    done = system.zv("set", "camera_front", "max_kbps=0")
    assert done.returncode == 2
    assert "allowed: a whole number from 10 to 1000000, or nil: not set" in done.stderr
    assert system.told("set", "camera_front", "max_kbps=10000") == "max_kbps: not set -> 10000\n"
    assert system.told("set", "camera_front", "max_kbps=nil") == "max_kbps: 10000 -> not set\n"


def test_a_name_and_its_value_are_taken_as_two_words_and_a_duration_with_its_unit(system):
    assert system.told("set", "camera_front", "quality", "62") == "quality: 80 -> 62\n"
    said = system.told("set", "camera_front", "stall_after", "1500ms", "quality=80")
    assert set(said.splitlines()) == {"stall_after: 5.0 -> 1.5", "quality: 62 -> 80"}
    assert system.value("camera_front", "stall_after") == 1.5
    system.put_back("camera_front", stall_after=5.0)


@pytest.mark.parametrize("value", ["-1", "-.5", "-1e3"])
def test_a_negative_number_is_a_value_which_the_node_may_refuse(system, value: str):
    done = system.zv("set", "camera_front", "noise", value)
    assert done.returncode == 2
    assert f"noise = {float(value)}" in done.stderr


def test_what_was_dumped_is_what_a_new_node_starts_with_and_what_load_brings_back(system, tmp_path):
    system.told("set", "tracker_front", "closing=7", "var_threshold=16.5", "detect_shadows=off")
    saved = tmp_path / "tracker.toml"
    done = system.zv("dump", "tracker_front", "-o", saved)
    assert (done.returncode, done.stdout) == (0, "")
    assert system.told("dump", "tracker_front") == saved.read_text()
    values = tomllib.loads(saved.read_text())
    dumped = json.loads(system.told("dump", "tracker_front", "--json"))
    unset = dict.fromkeys(("depth_min", "depth_max"))  # which TOML has no word for
    assert dumped == values | unset
    with some_services(system.endpoint, tmp_path) as start:
        start("tracker", "--camera", "rear", "--config", saved)
        wait_for_nodes(system.client, "tracker_rear")
        for name, value in values.items():
            assert system.value("tracker_rear", name) == value
    system.told("load", "tracker_front", "configs/tracker.toml")  # the defaults, as a whole file
    assert system.value("tracker_front", "closing") == 20
    changed = system.told("load", "tracker_front", saved).splitlines()
    assert set(changed) == {
        "closing: 20 -> 7",
        "var_threshold: 25.0 -> 16.5",
        "detect_shadows: true -> false",
    }
    system.told("load", "tracker_front", "configs/tracker.toml")


WRONG = {
    "out of range": (
        ["set", "camera_front", "quality=500", "flip=both"],
        (2, ["camera_front: quality = 500", "a whole number from 1 to 100"]),
    ),
    "wrong type": (["set", "camera_front", "quality=high"], (2, ["quality = 'high'", "1 to 100"])),
    "mistyped": (["set", "camera_front", "qualty=5"], (2, ["did you mean 'quality'?"])),
    "mistyped to read": (["get", "camera_front", "qualty"], (2, ["did you mean 'quality'?"])),
    "not live": (["set", "camera_front", "source=0"], (2, ["source cannot change while"])),
    "no value": (["set", "camera_front", "quality"], (2, ["'quality' is not NAME=VALUE"])),
    "nothing to set": (["set", "camera_front"], (2, ["NAME=VALUE"])),
    "no such node": (["set", "camera_fornt", "quality=5"], (1, ["did you mean camera_front?"])),
    "no node that matches": (
        ["set", "edge_*", "quality=5"],
        (1, ["nothing matches edge_*: these exist: camera_front, tracker_front"]),
    ),
    "several nodes": (["get", "camera_*", "quality"], (2, ["allowed: the name of one node"])),
    "no node's name": (["list", "@x/**"], (1, ["these exist: camera_front, tracker_front"])),
    "another namespace": (["list", "--namespace", "x"], (1, ["no node at all"])),
    "a pattern elsewhere": (
        ["list", "edge_*", "--namespace", "x"],
        (1, ["nothing matches edge_*: there is no node at all"]),
    ),
    "no such file": (["load", "camera_front", "missing.toml"], (3, ["missing.toml"])),
    "another node's file": (["load", "camera_front", "configs/edge.toml"], (2, ["'detector'"])),
    "two forms": (["dump", "camera_front", "--json", "-o", "x.toml"], (2, ["give one of them"])),
    "no folder": (["dump", "camera_front", "-o", "missing/x.toml"], (3, ["missing/x.toml"])),
}


@pytest.mark.parametrize(("arguments", "expected"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_one_line_with_its_status_and_changes_nothing(
    system, arguments: list[str], expected: tuple[int, list[str]]
):
    before = ask(system.client, "@vision/param/camera_front")[0].body
    done = system.zv(*arguments)
    status, said = expected
    assert (done.returncode, done.stdout) == (status, ""), done.stderr
    assert [text for text in said if text not in done.stderr] == [], done.stderr
    assert "Traceback" not in done.stderr
    assert ask(system.client, "@vision/param/camera_front")[0].body == before


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("quality = 2020-01-01", "quality = 2020-01-01 is not allowed"),
        ("quality = {x = 1}", "quality = {'x': 1} is not allowed"),
        ("quality = [", "not TOML"),
        ("quality = 5\nflip = 'none'\nrate = nan", "rate = nan is not allowed"),
    ],
)
def test_a_file_that_is_wrong_is_refused_as_a_whole(system, tmp_path, text: str, said: str):
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    done = system.zv("load", "camera_front", file)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr
    assert system.value("camera_front", "quality") == 80


def test_a_pattern_sets_each_node_that_matches_and_tells_of_those_that_refuse(system):
    both = system.told("set", "*_front", "quality=61")
    assert both == "camera_front quality: 80 -> 61\ntracker_front quality: 80 -> 61\n"
    one = system.zv("set", "?????*_front", "quality=80", "closing=7")
    assert (one.returncode, set(one.stdout.splitlines())) == (
        2,
        {"tracker_front quality: 61 -> 80", "tracker_front closing: 20 -> 7"},
    )
    assert "camera_front: there is no parameter 'closing'" in one.stderr
    assert "1 of 2 nodes that match ?????*_front were not set" in one.stderr
    assert system.value("camera_front", "quality") == 61
    system.put_back("camera_front", quality=80)
    system.put_back("tracker_front", closing=20)


@pytest.mark.parametrize("words", [("list", "plain"), ("list", "pl*"), ("set", "pl*", "x=1")])
def test_nodes_that_have_no_parameters_are_named_also_by_a_pattern(system, words: tuple[str, ...]):
    with system.client.liveliness().declare_token("@vision/node/plain"):
        done = system.zv(*words)
    assert (done.returncode, done.stdout) == (1, "")
    assert "plain runs, but does not answer for parameters" in done.stderr
    assert "nothing matches" not in done.stderr
