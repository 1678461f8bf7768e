"""A recorder at a real router: what arrives is in the file, as it was, and nothing twice."""

from __future__ import annotations

import os
import re
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgpack
import pytest
import zenoh

from tests.support.fork_server import ZV
from tests.support.listening import open_client
from tests.support.processes import START_S, Program
from tests.support.publishing import PlainCamera, wait_for_subscriber
from tests.support.waiting import wait_until
from zenoh_vision import Node, keys
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.messages import Centroid, Header
from zenoh_vision.topics import message_topic
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.link import Link
from zv.bag.record import Record
from zv.bag.recorder.plan import Plan
from zv.bag.recorder.recorder import Recorder
from zv.bag.recording import Recording
from zv.bag.report import report_of
from zv.bag.writer import CHUNK_BYTES
from zv.edge.settings import EdgeSettings
from zv.tools.bag.recorded_node import recorded_node


@pytest.fixture
def client(endpoint: str) -> Iterator[zenoh.Session]:
    with open_client(endpoint) as session:
        yield session


@contextmanager
def recording(endpoint: str, plan: Plan, name: str = "bag_record") -> Iterator[Recorder]:
    link = Link(Connection(connect=endpoint, timeout_s=10))
    recorder = Recorder(link, "vision", plan, name)
    recorder.start()
    try:
        yield recorder
    finally:
        recorder.stop()
        link.close()


def records_of(path: Path) -> list[Record]:
    with Recording(path) as found:
        assert not found.problems
        return list(found.records())


def test_keys_bytes_encodings_attachments_and_stamps_are_those_of_the_wire(
    endpoint: str, client: zenoh.Session, tmp_path: Path
) -> None:
    seen: list[zenoh.Sample] = []
    plan = Plan(tmp_path / "run.mcap", keys=("robot/**", "robot/arm/*", "@robot/state"))
    expected = [
        (
            "robot/arm/joint",
            bytes(range(256)),
            "application/cdr",
            b"\0\1",
            zenoh.Priority.REAL_TIME,
        ),
        ("robot/arm/joint", b"", "", None, zenoh.Priority.BACKGROUND),
        ("robot/big", os.urandom(3_000_000), "zenoh/bytes", b"", zenoh.Priority.DATA),
        ("@robot/state", b"on", "text/plain;v=1", None, zenoh.Priority.DATA),
    ]
    with recording(endpoint, plan) as recorder:
        for key in ("robot/arm/joint", "@robot/state"):
            wait_for_subscriber(client, key)
        listening = [client.declare_subscriber(key, seen.append) for key in plan.keys[::2]]
        for key, payload, encoding, attachment, priority in expected:
            client.put(
                key,
                payload,
                encoding=encoding or None,
                attachment=attachment,
                priority=priority,
                congestion_control=zenoh.CongestionControl.BLOCK,
                express=key == "robot/big",
                timestamp=client.new_timestamp(),
            )
        client.delete("robot/arm/joint", timestamp=client.new_timestamp())
        client.put("else/where", b"not asked for")
        wait_until(lambda: recorder.progress().taken == len(expected) + 1)
        wait_until(lambda: len(seen) == len(expected) + 1)
        for each in listening:
            each.undeclare()
    found = records_of(plan.output)
    # Samples of different priorities overtake each other; their stamps are unique.
    assert {
        f"{each.timestamp.ntp64}/{each.timestamp.clock}": (
            each.key,
            each.payload,
            each.encoding,
            each.attachment,
            each.priority,
            each.deleted,
            each.express,
        )
        for each in found
    } == {
        str(each.timestamp): (
            str(each.key_expr),
            each.payload.to_bytes(),
            str(each.encoding),
            None if each.attachment is None else each.attachment.to_bytes(),
            int(each.priority),
            each.kind == zenoh.SampleKind.DELETE,
            each.express,
        )
        for each in seen
    }
    assert len(found) == len(expected) + 1


def test_every_frame_is_taken_and_the_file_proves_it(
    endpoint: str, client: zenoh.Session, tmp_path: Path
) -> None:
    camera = PlainCamera(client)
    plan = Plan(tmp_path / "run.mcap")
    with recording(endpoint, plan) as recorder:
        wait_for_subscriber(client, "vision/front/image/compressed")
        for _ in range(300):
            camera.send()
        wait_until(lambda: recorder.progress().taken == 300)
    with Recording(plan.output) as found:
        report = report_of(found)
    assert report.verdict == "complete"


def test_a_recording_says_who_was_there_and_with_which_parameters(
    endpoint: str, tmp_path: Path
) -> None:
    plan = Plan(tmp_path / "run.mcap")
    connection = Connection(connect=endpoint, timeout_s=10)
    store = ParameterStore(EdgeSettings(high=150))
    with (
        Node("edge", connection=connection, publishes=("edges/contours",), parameters=store),
        recording(endpoint, plan) as recorder,
    ):
        before = recorder.progress().taken
        store.change({"high": 160})
        wait_until(lambda: recorder.progress().taken > before + 2)  # the change, and health
    with Recording(plan.output) as found:
        node = recorded_node(found, "edge")
        recorded = found.keys()
    assert node.service == "edge"
    assert node.settings(0)["high"] == 150
    assert node.settings(max(node.changes))["high"] == 160
    assert "@vision/schema/Contours" in recorded
    assert "@vision/diagnostics/edge_front" in recorded


def test_a_picture_for_display_only_is_not_asked_for(
    endpoint: str, client: zenoh.Session, tmp_path: Path
) -> None:
    with recording(endpoint, Plan(tmp_path / "run.mcap")):
        wait_for_subscriber(client, "vision/front/image/compressed")
        for key in ("vision/front/image", "vision/front/tracked/compressed"):
            with client.declare_publisher(key) as publisher:
                assert not publisher.matching_status.matching
    excluded = Plan(
        tmp_path / "x.mcap", keys=("vision/**",), exclude=("vision/*/image", "@vision/**")
    )
    with recording(endpoint, excluded) as recorder:
        wait_for_subscriber(client, "vision/front/image")
        client.put("vision/front/image", b"1")
        client.put("vision/front/centroid", b"2")
        wait_until(lambda: recorder.progress().taken == 1)
    assert {each.key for each in records_of(excluded.output)} == {"vision/front/centroid"}


def test_the_last_seconds_are_written_on_an_event_and_the_seconds_after(
    endpoint: str, client: zenoh.Session, tmp_path: Path
) -> None:
    camera = PlainCamera(client)
    plan = Plan(tmp_path / "box.mcap", last_s=30, after_s=0.3, on_event=("line_crossed:door",))
    with recording(endpoint, plan) as recorder:
        wait_for_subscriber(client, "vision/front/image/compressed")
        wait_for_subscriber(client, "vision/front/events")
        for _ in range(20):
            camera.send()
        wait_until(lambda: len(list(recorder._memory or ())) >= 20)
        assert not list(tmp_path.iterdir())
        fields = {"event": "line_crossed", "id": 3, "zone": "door", "x": 1.0, "y": 1.0}
        header = {"camera": "front", "epoch": 1, "seq": 20, "stamp_ns": 1, "width": 4, "height": 4}
        client.put(
            "vision/front/events",
            msgpack.packb({**fields, "header": header}),
            encoding="application/msgpack;vision.TrackEvent.v1",
            congestion_control=zenoh.CongestionControl.BLOCK,
        )
        camera.send()
        (path,) = wait_until(lambda: recorder.paths)
        assert path.name.endswith("-line_crossed-door.mcap")
        frames = [each for each in records_of(path) if each.key.endswith("compressed")]
        assert [each.number("seq") for each in frames] == list(range(21))

        replies = list(
            client.get(keys.record_key("vision", "*"), payload=msgpack.packb({"reason": "jam"}))
        )
        assert msgpack.unpackb(replies[0].ok.payload.to_bytes())["folder"] == str(tmp_path)
        path = wait_until(lambda: recorder.paths[1:])[0]
        assert path.name.endswith("-jam.mcap")
        with Recording(path) as found:
            assert report_of(found).verdict == "complete"


def test_a_recorder_killed_at_any_moment_leaves_all_but_its_last_second(
    endpoint: str, client: zenoh.Session, tmp_path: Path
) -> None:
    path = tmp_path / "run.mcap"
    camera = PlainCamera(client)
    words = ["bag", "record", "vision/**", "--connect", endpoint, "-o", str(path)]
    with Program(words, tmp_path, "record", forked=ZV) as program:
        wait_for_subscriber(client, "vision/front/image/compressed")
        sent: list[float] = []
        for _ in range(100):
            camera.send()
            sent.append(time.time())
            time.sleep(0.02)
        program.process.send_signal(signal.SIGKILL)
        killed = time.time()
        program.process.wait(20)
    assert not path.exists()
    found = [each.number("seq") for each in records_of(tmp_path / "run.mcap.partial")]
    frames = [each for each in found if each is not None]
    assert frames == list(range(len(frames)))
    assert len(frames) >= sum(each < killed - 1 for each in sent)


def test_a_file_that_cannot_be_made_ends_the_command_with_status_3(
    endpoint: str, tmp_path: Path
) -> None:
    (tmp_path / "there.mcap").touch()
    for name, error in (
        ("there.mcap", "exists already"),
        ("there.mcap/x.mcap", "cannot make the folder"),
    ):
        words = ["bag", "record", "--connect", endpoint, "-o", str(tmp_path / name)]
        with Program(words, tmp_path, "record", forked=ZV) as program:
            assert program.process.wait(20) == 3
            assert error in program.complaints
            assert "Traceback" not in program.complaints


@pytest.mark.parametrize(
    "words", [["bag", "record", "-o", "x.mcap"], ["recorder"]], ids=["tool", "service"]
)
def test_what_triggers_needs_last_seconds(endpoint: str, tmp_path: Path, words: list[str]) -> None:
    words = [*words, "--connect", endpoint, "--on-event", "line_crossed"]
    with Program(words, tmp_path, "record", forked=ZV, cwd=tmp_path) as program:
        assert program.process.wait(20) == 2
        assert "give --last" in program.complaints


def test_last_seconds_that_nothing_triggered_are_said_not_to_be_written(
    endpoint: str, tmp_path: Path
) -> None:
    words = ["bag", "record", "--connect", endpoint, "-o", str(tmp_path / "box.mcap")]
    with Program([*words, "--last", "5s", "--for", "100ms"], tmp_path, "box", forked=ZV) as box:
        assert box.process.wait(20) == 0
        assert "nothing triggered it: no file was written" in box.complaints


def test_a_key_of_which_nothing_was_recorded_is_named(
    endpoint: str, client: zenoh.Session, tmp_path: Path
) -> None:
    words = ["bag", "record", "--connect", endpoint, "vision/nobody/**"]
    with Node("bar", camera="front", connection=Connection(connect=endpoint, timeout_s=10)):
        for number, (more, status) in enumerate(((["other/**"], 0), ([], 1))):
            name = f"{number}.mcap"
            flags = [*more, "-o", str(tmp_path / name)]
            with Program([*words, *flags], tmp_path, name, forked=ZV) as program:
                wait_until(lambda at=program: "recording into" in at.complaints)
                wait_for_subscriber(client, "other/x" if more else "vision/nobody/x")
                client.put("other/x", b"1", congestion_control=zenoh.CongestionControl.BLOCK)
                partial = tmp_path / f"{name}.partial"
                sought = b"other/x" if more else b"@vision/diagnostics/bar_front"
                wait_until(lambda file=partial, text=sought: text in file.read_bytes())
                assert program.interrupt() == status
                assert "vision/nobody/**" in program.complaints
                assert "other/**" not in program.complaints


def test_what_a_slow_disk_cannot_take_is_counted_and_nothing_else_is_lost(
    endpoint: str, client: zenoh.Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = os.pwritev

    def slowly(file: int, buffers: list[memoryview], place: int) -> int:
        time.sleep(0.1)
        return write(file, buffers, place)

    monkeypatch.setattr(os, "pwritev", slowly)
    monkeypatch.setattr("zv.bag.writer.CHUNK_BYTES", 100_000)
    camera = PlainCamera(client, pictures=(os.urandom(100_000),))
    plan = Plan(tmp_path / "run.mcap", keys=("vision/**",), memory_bytes=1_000_000)
    with recording(endpoint, plan) as recorder:
        wait_for_subscriber(client, "vision/front/image/compressed")
        for _ in range(60):
            camera.send()
        wait_until(lambda: recorder.progress().taken + recorder.progress().missed == 60)
    with Recording(plan.output) as found:
        (report,) = (each for each in report_of(found).keys if each.key.endswith("compressed"))
    assert set(report.missed) == {"recorder_behind"}
    assert report.count + report.missed["recorder_behind"] == 60
    assert report.count >= 9


def test_a_disk_that_hangs_is_said_to_do_so_and_what_is_missed_is_counted_meanwhile(
    endpoint: str, client: zenoh.Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, goes_on = os.pwritev, threading.Event()

    def hanging(file: int, buffers: list[memoryview], place: int) -> int:
        goes_on.wait(START_S)
        return write(file, buffers, place)

    monkeypatch.setattr("zv.bag.recorder.recorder.SILENT_S", 0.3)
    camera = PlainCamera(client, pictures=(os.urandom(CHUNK_BYTES),))
    plan = Plan(tmp_path / "run.mcap", keys=("vision/**",), memory_bytes=10_000_000)
    with recording(endpoint, plan) as recorder:
        assert recorder.progress().delay == ""
        monkeypatch.setattr(os, "pwritev", hanging)
        wait_for_subscriber(client, "vision/front/image/compressed")
        for _ in range(5):
            camera.send()
        wait_until(lambda: recorder.progress().missed == 3)  # two of 4.2 MB fit into the queue
        wait_until(lambda: "has taken nothing for " in recorder.progress().delay)
        assert "what does not fit into memory_mb is missed" in recorder.progress().delay
        goes_on.set()
        monkeypatch.setattr("zv.bag.recorder.recorder.HOLD_S", 0.0)
        wait_until(lambda: recorder.progress().delay == "")
        wait_until(lambda: (recorder.progress().taken, recorder.progress().missed) == (2, 3))
        assert recorder.progress().failure == ""


def test_the_viewer_s_token_is_in_no_recording(
    endpoint: str, client: zenoh.Session, tmp_path: Path
) -> None:
    token = "a-token-that-nobody-else-has"
    plan = Plan(tmp_path / "run.mcap", keys=("**", "@vision/**"))
    with recording(endpoint, plan) as recorder:
        command = ["view", "--connect", endpoint, "--port", "0"]
        with Program(command, tmp_path, "view", forked=ZV, ZV_VIEWER_TOKEN=token) as viewer:
            wait_until(lambda: token in viewer.output)
            wait_until(lambda: recorder.progress().taken > 2)  # its health
            wait_until(lambda: any("viewer" in key for key in recorder._system._newest))
    assert "@vision/node/viewer" in {each.key for each in records_of(plan.output)}
    assert token.encode() not in plan.output.read_bytes()


def test_what_a_node_of_your_own_said_before_and_says_later_is_recorded(
    endpoint: str, tmp_path: Path
) -> None:
    mode = message_topic("mode", Centroid)
    connection = Connection(connect=endpoint, timeout_s=10)
    plan = Plan(tmp_path / "run.mcap")
    fields = {"camera": "front", "epoch": 1, "stamp_ns": 1, "width": 4, "height": 4}
    said = [
        Centroid(header=Header(seq=seq, **fields), x=seq, y=0, box=(0, 0, 1, 1), area=1.0)
        for seq in (1, 2)
    ]
    with Node("gate", connection=connection, publishes=(mode,)) as node:
        node.publish(mode, said[0])
        with recording(endpoint, plan) as recorder:
            wait_until(lambda: "vision/front/mode" in recorder.keys)
            wait_until(lambda: (node.publish(mode, said[1]), recorder.progress().taken > 2)[1])
    found = [each for each in records_of(plan.output) if each.key == "vision/front/mode"]
    assert (found[0].origin, found[0].payload) == ("query", said[0].to_bytes())
    assert (found[-1].origin, found[-1].payload) == ("stream", said[1].to_bytes())


def test_a_recorder_without_a_folder_waits_for_it_with_an_error_in_its_health(
    endpoint: str, client: zenoh.Session, tmp_path: Path
) -> None:
    place = tmp_path / "place"
    place.touch()
    camera = PlainCamera(client)
    words = ["recorder", "--connect", endpoint, "--output", str(place / "run.mcap")]
    with Program(words, tmp_path, "recorder", forked=ZV) as program:
        wait_for_subscriber(client, "vision/front/image/compressed")
        levels: list[tuple[int, str]] = []

        def note(sample: zenoh.Sample) -> None:
            fields = msgpack.unpackb(sample.payload.to_bytes())
            levels.append((fields["level"], fields["message"]))

        with client.declare_subscriber("@vision/diagnostics/recorder", note), camera.at(20):
            wait_until(lambda: levels and levels[-1][0] == 2)
            assert "cannot make the folder" in levels[-1][1]
            place.unlink()
            wait_until(lambda: levels[-1][0] == 0)
            wait_until(lambda: list(place.glob("run-*.mcap.partial")))
        assert program.interrupt() == 0
    (path,) = place.glob("run-*.mcap")
    with Recording(path) as found:
        report = next(each for each in report_of(found).keys if each.key.endswith("compressed"))
    assert report.count > 0
    assert report.missed["not_written"] > 0


def test_a_file_that_cannot_be_made_at_the_trigger_is_made_later(
    endpoint: str, client: zenoh.Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("zv.bag.recorder.files.RETRY_S", 0.2)
    place = tmp_path / "place"
    place.touch()
    camera = PlainCamera(client)
    plan = Plan(place / "box.mcap", last_s=30, after_s=0.3)
    with recording(endpoint, plan) as recorder:
        wait_for_subscriber(client, "vision/front/image/compressed")
        for _ in range(20):
            camera.send()
        wait_until(lambda: len(list(recorder._memory or ())) >= 20)
        recorder.trigger("jam")
        wait_until(lambda: "cannot make the folder" in recorder.progress().failure)
        recorder.trigger("late")  # of the same file
        place.unlink()
        (path,) = wait_until(lambda: recorder.paths)
        assert recorder.progress().failure == ""
    assert path.name.endswith("-jam.mcap")
    assert len(list(place.iterdir())) == 1
    frames = [each for each in records_of(path) if each.key.endswith("compressed")]
    assert [each.number("seq") for each in frames] == list(range(20))


def test_files_that_the_limit_has_deleted_are_counted_and_no_error(
    endpoint: str, client: zenoh.Session, tmp_path: Path
) -> None:
    camera = PlainCamera(client, pictures=(os.urandom(20_000),))
    words = ["bag", "record", "vision/**", "--connect", endpoint, "-o", str(tmp_path / "run.mcap")]
    limits = ["--split-mb", "0.1", "--total-mb", "0.3"]
    with Program([*words, *limits], tmp_path, "record", forked=ZV) as program:
        wait_for_subscriber(client, "vision/front/image/compressed")
        with camera.at(100):
            first = wait_until(lambda: list(tmp_path.glob("run-*.mcap")))[0]
            wait_until(lambda: not first.exists())
        assert program.interrupt() == 0, program.complaints
    assert re.search(r"^zv: \d+ older files? (was|were) deleted", program.complaints, re.MULTILINE)
    assert str(sorted(tmp_path.glob("run-*.mcap"))[-1]) in program.output
