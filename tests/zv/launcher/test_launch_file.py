"""The launch file: what it may say, and what is said of a wrong one."""

import socket
import sys
from pathlib import Path

import pytest

from tests.support.processes import run_program
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.transport.connection import Connection
from zv.cli.loading import load
from zv.launcher.command_line import service_flags
from zv.launcher.launch_file import PlannedNode, read_launch_file
from zv.launcher.starting import addresses, how_to_subscribe, launch_file, with_ports

ROOT = Path(__file__).parent.parent.parent.parent
NODE = '[[node]]\nservice = "camera"\n'


def launch(folder: Path, text: str) -> Path:
    path = folder / "up.toml"
    path.write_text(text)
    return path


def command_of(node) -> tuple[list[str], dict[str, str]]:
    assert isinstance(node, PlannedNode)
    return service_flags(node.service, node.settings)


def complaint(path: Path) -> str:
    with pytest.raises(ConfigurationError) as caught:
        read_launch_file(path)
    assert caught.value.exit_status == 2
    return str(caught.value)


def test_the_default_file_names_a_camera_a_tracker_and_an_edge_detector():
    plan = read_launch_file(ROOT / "configs" / "up.toml")
    names = ["camera_front", "tracker_front", "edge_front", "viewer"]
    assert [node.name for node in plan.nodes] == names
    assert plan.connection == {"namespace": "vision"}
    assert plan.listen == "tcp/127.0.0.1:7447"


NODES = ("camera", "tracker", "edge")


def test_a_system_is_checked_and_supervised_without_opencv():
    # Of the process that stays beside the nodes, it would be half of the start, and 30 MB.
    program = f"""
import sys
from pathlib import Path
import zv.launcher.starting
from zv.launcher.launch_file import read_launch_file
read_launch_file(Path({str(ROOT / "configs" / "up.toml")!r}))
print({{"av", "cv2", "numpy", "simplejpeg"}} & set(sys.modules))
"""
    done = run_program([sys.executable, "-c", program])
    assert (done.stdout, done.stderr) == ("set()\n", "")


def test_a_node_is_given_what_it_may_take_of_the_processors(tmp_path: Path):
    limits = 'threads = 2\nnice = 5\naffinity = "0-1"\n'
    (node,) = read_launch_file(launch(tmp_path, NODE + limits)).nodes
    assert node.variables == {"ZV_THREADS": "2", "ZV_NICE": "5", "ZV_AFFINITY": "0-1"}
    (program,) = read_launch_file(
        launch(tmp_path, f'{NODE}command = "sh"\n{limits}env = {{ A = "1", ZV_NICE = "7" }}\n')
    ).nodes
    assert program.variables == {**node.variables, "ZV_NICE": "7", "A": "1"}
    (unlimited,) = read_launch_file(launch(tmp_path, NODE)).nodes
    assert unlimited.variables == {}


def test_two_cameras_differ_in_name_and_scene():
    plan = read_launch_file(ROOT / "configs" / "two-cameras.toml")
    assert {node.name for node in plan.nodes} == {
        *(f"{service}_{camera}" for service in NODES for camera in ("left", "right")),
        "viewer",  # as in the standard file
    }
    assert [command_of(node)[0][1:] for node in plan.nodes[:2]] == [
        ["--camera", "left"],
        ["--camera", "right", "--seed", "2"],
    ]


@pytest.mark.parametrize("cameras", ["left,right", "*"])
def test_one_tracker_may_serve_several_cameras(tmp_path: Path, cameras: str):
    path = launch(tmp_path, f'[[node]]\nservice = "tracker"\ncamera = "{cameras}"\n')
    (node,) = read_launch_file(path).nodes
    assert node.name == "tracker"
    assert command_of(node)[0] == ["tracker", "--camera", cameras]


def test_each_camera_of_a_tracker_is_remapped(tmp_path: Path):
    path = launch(tmp_path, '[[node]]\nservice = "tracker"\ncamera = "left,right"\n')
    (node,) = read_launch_file(path, {"left": "bay"}).nodes
    assert command_of(node)[0] == ["tracker", "--camera", "bay,right"]


@pytest.mark.parametrize(
    ("cameras", "keys"),
    [("left,right", ["left", "right"]), ("*", ["*"]), ("left", ["left"])],
)
def test_the_keys_of_each_camera_of_a_tracker_are_shown(
    tmp_path: Path, cameras: str, keys: list[str]
):
    path = launch(tmp_path, f'[[node]]\nservice = "tracker"\ncamera = "{cameras}"\n')
    said = how_to_subscribe(read_launch_file(path), Connection(), own_router=True)
    shown = [line.split()[0] for line in said if line.startswith("  ")]
    assert shown == [f"vision/{key}/centroid" for key in keys]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ["node", "missing"]),
        ("node = 3\n", ["node", "3"]),
        ("nodes = []\n" + NODE, ["'nodes'", "did you mean 'node'"]),
        (NODE.replace("node", "nodes"), ["'nodes'", "did you mean 'node'"]),
        ('[[node]]\nservce = "camera"\n', ["'servce'", "did you mean 'service'"]),
        ('[router]\nlisen = "x"\n' + NODE, ["router.lisen", "did you mean 'listen'"]),
        ("[router]\nlisten = 7447\n" + NODE, ["router.listen = 7447", "PROTOCOL/HOST:PORT"]),
        ('[router]\nlisten = "tcp/h:99999"\n' + NODE, ["router.listen = 'tcp/h:99999'", "65535"]),
        ('[router]\nconnect = "host"\n' + NODE, ["router.connect = 'host'", "PROTOCOL/HOST:PORT"]),
        ('[router]\nzenoh_config = "x.json5"\n' + NODE, ["router.zenoh_config", "'x.json5'"]),
        ("namespace = 1\n" + NODE, ["namespace = 1", "letters a-z"]),
        ('namespace = "My NS"\n' + NODE, ["namespace = 'My NS'", "letters a-z, digits and _"]),
        ('[node]\nservice = "camera"\n', ["node = ", "one or more [[node]]"]),
        ("node = []\n", ["node = []", "one or more [[node]]"]),
        ('[[node]]\ncamera = "x"\n', ["node[0].service is missing", "camera, tracker, edge"]),
        (NODE + 'camera = "Front!"\n', ["node[0].camera = 'Front!'", "letters a-z, digits and _"]),
        (NODE + 'camera = "*"\n', ["node[0].camera = '*'", "serves one camera"]),
        ('[[node]]\nservice = "edge"\ncamera = "a,b"\n', ["a,b", "one camera"]),
        (
            '[[node]]\nservice = "x"\ncommand = "sh"\ncamera = "a,b"\n',
            ["'a,b'", "serves one camera"],
        ),
        (NODE + "config = 3\n", ["node[0].config = 3", "a text"]),
        ('[[node]]\nservice = "camra"\n', ["node[0].service = 'camra'", "mean 'camera'?"]),
        ('[[node]]\nservice = "router"\n', ["node[0]", "'router'"]),
        (NODE + "restart = 1\n", ["node[0].restart", "1"]),
        ("grace = -1\n" + NODE, ["grace = -1", "a duration", "from 0s to 1h", "default 5s"]),
        (NODE + NODE, ["node[1]", "already a camera for front"]),
        (NODE + "settings = { qualty = 3 }\n", ["settings", "'qualty'", "did you mean 'quality'"]),
        (NODE + "settings = { quality = 300 }\n", ["quality = 300", "1 to 100"]),
        (NODE + "settings = [1]\n", ["node[0].settings = [1]", "options that override"]),
        (
            '[[node]]\nservice = "relay"\nsettings = { key = "centroid" }\n',
            ["node[0].settings: KEY = 'centroid'", "no stream of pictures"],
        ),
        (NODE + 'settings = { quality = "3" }\n', ["quality = '3'"]),
        (NODE + 'settings = { camera = "x" }\n', ["settings.camera = 'x'", "beside settings"]),
        (NODE + 'config = "none.toml"\n', ["node[0].config = 'none.toml'", "there is no file"]),
        (NODE + "nice = 20\n", ["node[0].nice = 20 is not allowed (above 19); allowed: a whole"]),
        (NODE + "threads = -1\n", ["node[0].threads = -1 is not allowed (below 0)"]),
        (
            NODE + 'affinity = "1-0"\n',
            ["node[0].affinity = '1-0' is not allowed (1-0 ends before it begins)"],
        ),
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
    assert command_of(node)[0][1:] == ["--camera", "front", "--rate", "5.0", "--quality", "40"]


def test_a_wrong_value_in_a_config_file_is_blamed_on_that_file(tmp_path):
    (tmp_path / "mine.toml").write_text("quality = 0\n")
    message = complaint(launch(tmp_path, NODE + 'config = "mine.toml"\n'))
    assert str(tmp_path / "mine.toml") in message
    assert "quality = 0" in message


def test_the_environment_goes_over_config_and_settings_go_over_both(tmp_path, monkeypatch):
    monkeypatch.setenv("ZV_CAMERA_SOURCE", "0")
    monkeypatch.setenv("ZV_CAMERA_QUALITY", "9")
    (tmp_path / "mine.toml").write_text('quality = 30\nsource = "walk.avi"\n')
    text = NODE + 'config = "mine.toml"\nsettings = { source = "synthetic", loop = true }\n'
    (node,) = read_launch_file(launch(tmp_path, text)).nodes
    # The default is a flag too, since the process inherits the variable.
    assert command_of(node)[0][1:] == [
        *("--camera", "front", "--source", "synthetic", "--loop", "--quality", "9")
    ]
    (node,) = read_launch_file(launch(tmp_path, NODE)).nodes
    assert command_of(node)[0][1:] == ["--camera", "front", "--source", "0", "--quality", "9"]


def test_a_variable_of_one_node_does_not_change_the_two_cameras(monkeypatch):
    monkeypatch.setenv("ZV_CAMERA_SOURCE", "0")
    plan = read_launch_file(ROOT / "configs" / "two-cameras.toml")
    assert [node.settings.source for node in plan.nodes[:2]] == ["synthetic"] * 2


@pytest.mark.parametrize(
    "url",
    [
        "rtsp://me:secret@10.0.0.9/1",
        "http://10.0.0.9/mjpg?user=a&pwd=secret",
        "rtsp://admin:se/cret@10.0.0.9/",
        "rtsp://admin:se[cret@10.0.0.9/",
        "rtsp://10.0.0.9/user=admin_password=secret_channel=1",
        "rtsp://admin:secret",
        "admin:secret@10.0.0.9/1",
    ],
)
def test_a_secret_in_a_url_goes_by_environment_where_other_users_cannot_read_it(tmp_path, url):
    (node,) = read_launch_file(
        launch(tmp_path, NODE + f'settings = {{ source = "{url}" }}\n')
    ).nodes
    assert command_of(node) == (["camera", "--camera", "front"], {"ZV_CAMERA_SOURCE": url})


def test_a_password_of_its_own_goes_by_environment_too(tmp_path):
    text = 'settings = { source = "rtsp://10.0.0.9/1", username = "admin", password = "p/w#?" }\n'
    (node,) = read_launch_file(launch(tmp_path, NODE + text)).nodes
    arguments, secrets = command_of(node)
    assert secrets == {"ZV_CAMERA_PASSWORD": "p/w#?"}
    assert arguments[3:] == ["--source", "rtsp://10.0.0.9/1", "--username", "admin"]


def test_a_program_as_source_is_started_by_its_camera_and_its_secrets_are_not_shown(tmp_path):
    for command, shown in (("ffmpeg -i rtsp://10.0.0.9/1 -", True), ("cat rtsp://a:b@c/1", False)):
        text = f'settings = {{ source = "command:{command}" }}\n'
        (node,) = read_launch_file(launch(tmp_path, NODE + text)).nodes
        arguments, secrets = command_of(node)
        assert ("--source" in arguments) is shown
        assert ("ZV_CAMERA_SOURCE" in secrets) is not shown


@pytest.mark.parametrize(
    "source", ["rtsp://10.0.0.9/1", "user@host.avi", "http://[broken", "rtsp://[fe80::1]:554/1"]
)
def test_what_holds_no_secret_can_be_seen_and_repeated(tmp_path, monkeypatch, source):
    monkeypatch.chdir(tmp_path)
    Path("user@host.avi").touch()
    text = NODE + f'settings = {{ source = "{source}" }}\n'
    (node,) = read_launch_file(launch(Path(), text)).nodes
    assert command_of(node) == (["camera", "--camera", "front", "--source", source], {})


@pytest.mark.parametrize(
    "settings",
    [
        '{ source = "-1.avi", quality = 7, loop = true, rate = 0.5, fourcc = "MJPG" }',
        "{ seed = 4294967295, frozen_after = 0.0, flip = 'both', faults = 'stall@9+6' }",
    ],
)
def test_the_command_line_of_a_node_means_the_same_settings(tmp_path, monkeypatch, settings):
    monkeypatch.chdir(tmp_path)
    Path("-1.avi").touch()
    (node,) = read_launch_file(launch(Path(), NODE + f"settings = {settings}\n")).nodes
    understood = []
    monkeypatch.setattr("zv.camera.service.run", lambda found, _: understood.append(found))
    monkeypatch.setattr("signal.signal", lambda *_: None)
    arguments, _ = command_of(node)
    load("camera").main(arguments[1:], standalone_mode=False)
    assert understood == [node.settings]


def test_a_viewer_belongs_to_no_camera(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    path = launch(tmp_path, '[[node]]\nservice = "viewer"\ncamera = "front"\n')
    with pytest.raises(ConfigurationError, match=r"node\[0\]\.camera = 'front' is not allowed"):
        read_launch_file(path)
    path = launch(tmp_path, '[[node]]\nservice = "viewer"\nsettings = { port = 0 }\n')
    (node,) = with_ports(read_launch_file(path)).nodes
    assert node.name == "viewer"
    assert node.settings.port > 0
    events = tmp_path / "zenoh-vision" / "events"  # of the user's state
    words = ["view", "--port", str(node.settings.port), "--events-dir", str(events)]
    assert command_of(node) == (words, {})


def test_a_viewer_looks_for_recordings_where_the_recorder_writes_them(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    recorder = '[[node]]\nservice = "recorder"\nsettings = {{ {} }}\n'
    viewer = '[[node]]\nservice = "viewer"\nsettings = {{ {}port = 0 }}\n'

    def found(output: str = "", own: str = "") -> str | None:
        path = launch(tmp_path, recorder.format(output) + viewer.format(own))
        return with_ports(read_launch_file(path)).nodes[1].settings.recordings_dir

    assert found() == str(Path("recordings").absolute())
    assert found('output = "kept/run.mcap"') == str(tmp_path / "kept")
    assert found(own='recordings_dir = "mine", ') == str(tmp_path / "mine")


def test_a_token_goes_by_the_environment_and_into_the_address(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    path = launch(
        tmp_path, '[[node]]\nservice = "viewer"\nsettings = { host = "0.0.0.0", port = 0 }\n'
    )
    plan = with_ports(read_launch_file(path))
    flags, secret = command_of(plan.nodes[0])
    (token,) = secret.values()
    assert list(secret) == ["ZV_VIEWER_TOKEN"]
    assert token not in " ".join(flags)
    (address,) = addresses(plan)
    assert address.endswith(f"/?token={token}")
    assert "0.0.0.0" not in address


def test_a_viewer_with_another_name_gets_its_token_into_the_address(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    text = """[[node]]
service = "viewer"
[node.settings]
port = 0
allow_host = "robot.example"
"""
    plan = with_ports(read_launch_file(launch(tmp_path, text)))
    (address,) = addresses(plan)
    token = (tmp_path / "zenoh-vision" / "viewer_token").read_text().strip()
    assert address.endswith(f"/?token={token}")


def test_a_viewers_port_that_is_taken_is_named_with_the_ways_out_that_there_are(
    tmp_path, monkeypatch
):
    table = '[[node]]\nservice = "viewer"\nsettings = { port = %d }\n'
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        path = launch(tmp_path, table % port)
        with pytest.raises(ConfigurationError) as refused:
            with_ports(read_launch_file(path))
        assert str(refused.value) == (
            f"{path}: viewer: port {port} on 127.0.0.1 is in use, perhaps by another viewer; "
            "choose another with port = PORT in the settings of its [[node]], "
            "or ZV_VIEWER_PORT=PORT if they have none"
        )
        assert with_ports(read_launch_file(launch(tmp_path, table % 0)))  # one way out
        monkeypatch.setenv("ZV_VIEWER_PORT", "0")  # the other
        assert with_ports(read_launch_file(launch(tmp_path, '[[node]]\nservice = "viewer"\n')))


def test_without_a_file_of_this_folder_the_standard_one_is_found(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert (
        read_launch_file(launch_file(None)).nodes
        == read_launch_file(ROOT / "configs" / "up.toml").nodes
    )
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "up.toml").write_text('[[node]]\nservice = "edge"\n')
    assert len(read_launch_file(launch_file(None)).nodes) == 1


def test_the_greeting_names_the_keys_and_a_message_to_read_for_example():
    plan = read_launch_file(ROOT / "configs" / "up.toml")
    router, *keys, example, viewer = how_to_subscribe(plan, Connection(), own_router=True)
    assert router.endswith("(started); published keys, for any Zenoh program:")
    suffixes = ["image/compressed", "centroid", "edges/compressed"]
    assert [key.split()[0] for key in keys] == [f"vision/front/{suffix}" for suffix in suffixes]
    assert "zv topic echo vision/front/centroid --connect tcp/127.0.0.1:7447" in example
    assert viewer.startswith("viewer: http://127.0.0.1:")


def test_the_greeting_of_programs_alone_promises_no_keys(tmp_path):
    file = tmp_path / "up.toml"
    file.write_text('[[node]]\nservice = "mine"\ncommand = "sh -c true"\n')
    lines = how_to_subscribe(read_launch_file(file), Connection(), own_router=True)
    assert lines == ["router: tcp/127.0.0.1:7447 (started)"]
