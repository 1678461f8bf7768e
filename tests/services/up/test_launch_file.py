"""The launch file: what it may say, and what is said of a wrong one."""

from pathlib import Path

import pytest

from common.errors import ConfigurationError
from services.up.launch_file import flags_of, read_launch_file, with_router

ROOT = Path(__file__).parent.parent.parent.parent
NODE = '[[node]]\nservice = "camera"\n'


def launch(folder: Path, text: str) -> Path:
    path = folder / "up.toml"
    path.write_text(text)
    return path


def complaint(path: Path) -> str:
    with pytest.raises(ConfigurationError) as caught:
        read_launch_file(path)
    assert caught.value.exit_status == 2
    return str(caught.value)


def test_the_default_file_names_a_camera_a_tracker_and_an_edge_detector():
    plan = read_launch_file(ROOT / "configs" / "up.toml")
    assert [node.name for node in plan.nodes] == ["camera_front", "tracker_front", "edge_front"]
    assert plan.namespace == "vision"
    assert plan.router.listen == "tcp/127.0.0.1:7447"


def test_two_cameras_differ_in_name_and_scene():
    plan = read_launch_file(ROOT / "configs" / "two-cameras.toml")
    assert sorted(node.name for node in plan.nodes) == sorted(
        f"{service}_{camera}"
        for service in ("camera", "tracker", "edge")
        for camera in ("left", "right")
    )
    assert [flags_of(node.settings) for node in plan.nodes[:2]] == [
        ["--camera", "left"],
        ["--camera", "right", "--seed", "2"],
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ["node", "missing"]),
        ("node = 3\n", ["node", "3"]),
        ("nodes = []\n" + NODE, ["'nodes'", "did you mean 'node'"]),
        ('[router]\nlisen = "x"\n' + NODE, ["router.lisen", "did you mean 'listen'"]),
        ('[router]\nlisten = "7447"\n' + NODE, ["router.listen", "'7447'", "tcp"]),
        ('namespace = "a/b"\n' + NODE, ["namespace", "'a/b'"]),
        ('[[node]]\nservice = "camra"\n', ["node[0]", "'camra'", "camera, tracker, edge"]),
        ('[[node]]\nservice = "router"\n', ["node[0]", "'router'"]),
        (NODE + "restart = 1\n", ["node[0].restart", "1"]),
        (NODE + NODE, ["node[1]", "camera_front"]),
        (NODE + "settings = { qualty = 3 }\n", ["settings", "'qualty'", "did you mean 'quality'"]),
        (NODE + "settings = { quality = 300 }\n", ["quality = 300", "1 to 100"]),
        (NODE + 'settings = { quality = "3" }\n', ["quality = '3'"]),
        (NODE + 'settings = { camera = "x" }\n', ["camera stands beside settings"]),
        (NODE + 'config = "none.toml"\n', ["none.toml", "No such file"]),
        ("[[node]\n", ["not TOML", "line 1"]),
    ],
)
def test_a_wrong_file_is_refused_naming_place_value_and_what_is_allowed(tmp_path, text, said):
    path = launch(tmp_path, text)
    message = complaint(path)
    assert str(tmp_path) in message
    assert all(word in message for word in said), message


def test_a_config_file_stands_beside_the_launch_file_and_settings_go_over_it(tmp_path):
    (tmp_path / "mine.toml").write_text("quality = 30\nrate = 5.0\n")
    path = launch(tmp_path, NODE + 'config = "mine.toml"\nsettings = { quality = 40 }\n')
    (node,) = read_launch_file(path).nodes
    assert flags_of(node.settings) == ["--camera", "front", "--rate", "5.0", "--quality", "40"]


def test_a_wrong_value_in_a_config_file_is_blamed_on_that_file(tmp_path):
    (tmp_path / "mine.toml").write_text("quality = 0\n")
    message = complaint(launch(tmp_path, NODE + 'config = "mine.toml"\n'))
    assert str(tmp_path / "mine.toml") in message
    assert "quality = 0" in message


def test_the_environment_goes_over_the_files(tmp_path, monkeypatch):
    monkeypatch.setenv("ZV_CAMERA_SOURCE", "0")
    path = launch(tmp_path, NODE + 'settings = { source = "synthetic", loop = true }\n')
    (node,) = read_launch_file(path).nodes
    assert flags_of(node.settings) == ["--camera", "front", "--source", "0", "--loop"]


@pytest.mark.parametrize(
    ("listen", "reach"),
    [
        ("tcp/127.0.0.1:7447", "tcp/127.0.0.1:7447"),
        ("tcp/0.0.0.0:7447#so_sndbuf=65536", "tcp/127.0.0.1:7447"),
        ("tcp/[::]:7000", "tcp/[::1]:7000"),
    ],
)
def test_nodes_on_this_machine_reach_a_router_that_listens_everywhere(tmp_path, listen, reach):
    plan = with_router(read_launch_file(launch(tmp_path, NODE)), listen=listen, connect=None)
    assert plan.router.reach == reach


def test_a_malformed_endpoint_on_the_command_line_is_refused(tmp_path):
    plan = read_launch_file(launch(tmp_path, NODE))
    with pytest.raises(ConfigurationError, match=r"--connect = 'here'.*tcp/HOST:PORT"):
        with_router(plan, listen=None, connect="here")
