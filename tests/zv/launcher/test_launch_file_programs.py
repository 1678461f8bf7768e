"""Nodes that are programs of the user's own, and cameras that are renamed, in a launch file."""

import sys
from pathlib import Path

import pytest

from tests.support.processes import ROOT
from zenoh_vision.errors import ConfigurationError
from zv.launcher.launch_file import PlannedProgram, read_launch_file, remapped_cameras

SH = '[[node]]\nservice = "mine"\ncommand = "sh -c true"\n'


def launch(folder: Path, text: str) -> Path:
    path = folder / "up.toml"
    path.write_text(text)
    return path


def planned(folder: Path, text: str) -> PlannedProgram:
    (node,) = read_launch_file(launch(folder, text)).nodes
    assert isinstance(node, PlannedProgram)
    return node


@pytest.mark.parametrize(
    "command",
    ["""'sh -c "echo $HOME" *'""", '["sh", "-c", "echo $HOME", "*"]'],
    ids=["text", "list"],
)
def test_a_command_is_words_in_which_nothing_is_expanded(tmp_path, command):
    node = planned(tmp_path, f'[[node]]\nservice = "mine"\ncommand = {command}\n')
    assert node.words[1:] == ("-c", "echo $HOME", "*")
    assert Path(node.words[0]).name == "sh"
    assert (node.name, node.folder, node.restart) == ("mine", tmp_path, True)


def test_the_documented_example_is_started_as_its_comments_say(tmp_path):
    page = (ROOT / "docs" / "configuration.md").read_text()
    example = page.partition("### A program of your own")[2].partition("```toml\n")[2]
    (tmp_path / "brightness.toml").touch()
    node = planned(tmp_path, example.partition("```")[0])
    assert node.name == "brightness_front"
    assert node.words[1:] == (
        "brightness.py",
        "--camera=front",
        f"--config={tmp_path / 'brightness.toml'}",
        "--gain=2.0",
        "--loop",
        "--zone=a",
        "--zone=b",
    )
    assert node.variables == {"OMP_NUM_THREADS": "1"}


def test_false_is_a_flag_and_a_value_that_begins_with_a_dash_stays_a_value(tmp_path):
    node = planned(tmp_path, SH + 'settings = { draw_all = false, offset = -3, file = "-1.avi" }\n')
    assert node.words[3:] == ("--no-draw-all", "--offset=-3", "--file=-1.avi")


def test_a_program_with_a_slash_is_found_from_its_working_directory(tmp_path):
    (tmp_path / "bin").mkdir()
    script = tmp_path / "bin" / "run.sh"
    script.write_text("#!/bin/sh\n")
    script.chmod(0o755)
    text = '[[node]]\nservice = "mine"\ncommand = "./run.sh"\ncwd = "bin"\n'
    node = planned(tmp_path, text)
    assert (Path(node.words[0]).resolve(), node.folder) == (script, tmp_path / "bin")


def test_python_is_the_one_that_runs_zv_unless_an_environment_is_active(tmp_path, monkeypatch):
    other = tmp_path / "python"
    other.write_text("#!/bin/sh\n")
    other.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    text = '[[node]]\nservice = "mine"\ncommand = "python x.py"\n'
    monkeypatch.delenv("VIRTUAL_ENV", raising=False)
    assert planned(tmp_path, text).words[0] == str(Path(sys.executable).parent / "python")
    monkeypatch.setenv("VIRTUAL_ENV", "/active")
    assert planned(tmp_path, text).words[0] == str(other)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('command = "nosuch x.py"\n', ["node[0].command", "mine", "'nosuch' on PATH"]),
        ('command = "./nosuch"\n', ["node[0].command", "mine", "there is no file", "/nosuch"]),
        ('command = "./up.toml"\n', ["node[0].command", "mine", "up.toml is not executable"]),
        ('command = ""\n', ["node[0].command", "mine", "it is empty"]),
        ("command = []\n", ["node[0].command", "mine", "it is empty"]),
        ("command = 'sh -c \"'\n", ["node[0].command", "no closing quotation", "a list"]),
        ("command = 3\n", ["node[0].command = 3", "a list of its arguments"]),
        ('command = ["sh", 3]\n', ["node[0].command[1] = 3", "a list of its arguments"]),
        ('command = "sh"\nenv = { A = true }\n', ["node[0].env.A = True", "environment variables"]),
        ('command = "sh"\nenv = { "A B" = "" }\n', ["node[0].env.A B", "environment variables"]),
        ('command = "sh"\nenv = { A = "\\u0000" }\n', ["node[0].env.A", "NUL"]),
        ('command = "sh"\ncwd = "nosuch"\n', ["node[0].cwd = 'nosuch'", "there is no folder"]),
        ('command = "sh"\ncwdd = "x"\n', ["node[0].cwdd", "did you mean 'cwd'?", "restart"]),
        ('command = "sh"\nsettings = { a = { b = 1 } }\n', ["settings.a", "a text, a number"]),
        ('command = "sh"\nsettings = { "a b" = 1 }\n', ["settings", "'a b'", "become flags"]),
        ('command = "sh"\nsettings = { camera = "x" }\n', ["settings.camera", "beside settings"]),
        ('command = "sh"\nconfig = "nosuch.toml"\n', ["node[0].config", "there is no file"]),
    ],
)
def test_a_wrong_command_is_refused_naming_file_node_key_and_what_is_allowed(tmp_path, text, said):
    path = launch(tmp_path, '[[node]]\nservice = "mine"\n' + text)
    with pytest.raises(ConfigurationError) as caught:
        read_launch_file(path)
    message = str(caught.value)
    assert all(words in message for words in [str(path), "allowed:", *said]), message


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('service = "My Node"\ncommand = "sh"\n', ["node[0].service = 'My Node'", "[a-z0-9_]+"]),
        ('service = "router"\ncommand = "sh"\n', ["node[0].service = 'router'", "of your own"]),
        ('service = "mine"\n', ["node[0].service = 'mine'", "with command = ..."]),
        ('service = "edge"\nenv = { A = "1" }\n', ["node[0].env", "with command = ..."]),
        ('service = "edge"\ncwd = "."\n', ["node[0].cwd", "with command = ..."]),
    ],
)
def test_a_name_of_ones_own_needs_a_command_and_a_service_of_zv_takes_none(tmp_path, text, said):
    with pytest.raises(ConfigurationError) as caught:
        read_launch_file(launch(tmp_path, "[[node]]\n" + text))
    assert all(words in str(caught.value) for words in said), caught.value


# Remapping

THREE = """[[node]]
service = "camera"
[[node]]
service = "viewer"
[[node]]
service = "mine"
command = "sh"
camera = "front"
[[node]]
service = "other"
command = "sh"
"""


def test_a_remapped_camera_is_renamed_in_every_node_that_has_it(tmp_path):
    nodes = read_launch_file(launch(tmp_path, THREE + '[remap]\nfront = "left"\n')).nodes
    assert [node.name for node in nodes] == ["camera_left", "viewer", "mine_left", "other"]
    assert nodes[2].words[1:] == ("--camera=left",)
    assert nodes[3].words[1:] == ()


def test_a_flag_overrides_the_table_and_two_cameras_can_be_swapped(tmp_path):
    two = '[[node]]\nservice = "edge"\ncamera = "back"\n'
    path = launch(tmp_path, THREE + two + '[remap]\nfront = "left"\n')
    nodes = read_launch_file(path, remapped_cameras(["front=back", "back=front"])).nodes
    assert [node.name for node in nodes] == [
        "camera_back", "viewer", "mine_back", "other", "edge_front"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("table", "flags", "said"),
    [
        ('[remap]\nfornt = "x"\n', [], ["remap.fornt", "did you mean 'front'?"]),
        ('[remap]\n"Front!" = "x"\n', [], ["remap.Front!", "OLD = "]),
        ('[remap]\nfront = "X!"\n', [], ["remap.front = 'X!'", "OLD = "]),
        ("remap = 3\n", [], ["remap = 3", "OLD = "]),
        ("", ["side=x"], ["--remap side", "no node has this camera", "allowed: front"]),
        (
            "",
            ["front"],
            [
                "--remap = 'front' is not allowed; allowed: OLD=NEW, two names of cameras: "
                "letters a-z, digits and _, at most 64 characters"
            ],
        ),
        ("", ["front:=x"], ["--remap = 'front:=x'", "OLD=NEW"]),
        ("", ["front=" + "x" * 65], ["--remap = 'front=xxx", "digits and _, at most 64"]),
        ("", ["front=x", "front=y"], ["--remap = 'front=y'", "given before"]),
    ],
)
def test_a_wrong_remapping_is_refused(tmp_path, table, flags, said):
    with pytest.raises(ConfigurationError) as caught:
        read_launch_file(launch(tmp_path, table + THREE), remapped_cameras(flags))
    assert all(words in str(caught.value) for words in said), caught.value


def test_two_cameras_cannot_become_one(tmp_path):
    two = '[[node]]\nservice = "camera"\ncamera = "back"\n'
    with pytest.raises(ConfigurationError, match="already a camera for back"):
        read_launch_file(launch(tmp_path, THREE + two), {"front": "back"})


@pytest.mark.parametrize(
    ("one", "other", "said"),
    [
        ("left", "left,right", "already a tracker for left"),
        ("left", "*", "already a tracker for all cameras"),
        ("left,right", "front,back", "already a node called tracker"),
    ],
)
def test_two_trackers_do_not_serve_one_camera(tmp_path, one, other, said):
    two = "".join(f'[[node]]\nservice = "tracker"\ncamera = "{each}"\n' for each in (one, other))
    with pytest.raises(ConfigurationError, match=said):
        read_launch_file(launch(tmp_path, two))
