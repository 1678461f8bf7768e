"""``zv bag verify``: the same frames give the same results, and a difference is found."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import msgpack
import pytest

from tests.integration.conftest import Service
from tests.support import detector_models
from tests.support.fork_server import ZV
from tests.support.listening import Listener, open_client, wait_for_nodes
from tests.support.node_states import description, report
from tests.support.processes import Program, run_program
from tests.support.publishing import wait_for_subscriber
from tests.support.recordings import BEGIN_NS, centroids, frames, write
from tests.support.routing import Router
from tests.support.waiting import wait_until
from zenoh_vision.config.settings import load_settings
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.keys import msgpack_of
from zenoh_vision.messages import CameraInfo, Diagnostics, NodeDescription, TrackEvent, Tracks
from zv.bag.record import Record
from zv.bag.recording import Recording
from zv.bag.writer import PARTIAL
from zv.tools.bag.verify_options import VerifyOptions

FRAMES = frames(45, still=25)
KEY = "vision/front/tracks"
LATER_NS = 2 * 10**9

Zv = Callable[..., Program]


DIFFERS = "its results may differ"


def diagnosed(record: Record, route: str) -> Record:
    """Return a report of the tracker, of a record's time, that says how it took its frames."""
    key, encoding = "@vision/diagnostics/tracker_front", msgpack_of(Diagnostics.schema_name)
    payload = report(routes={"vision/front/image/compressed": route}).to_bytes()
    return replace(record, key=key, payload=payload, encoding=encoding, attachment=None)


@pytest.fixture
def zv(tmp_path: Path) -> Zv:
    """``zv("bag", "verify", ...)`` runs it to its end."""
    number = 0

    def run(*words: object, status: int = 0) -> Program:
        nonlocal number
        number += 1
        program = Program(
            ["bag", "verify", *words], tmp_path, f"verify{number}", forked=ZV, cwd=tmp_path
        )
        with program:
            assert program.process.wait(90) == status, program.complaints
        return program

    return run


@pytest.fixture(scope="module")
def golden(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a few hundred kB: frames of a square that moves, and a tracker's results.

    It is of the recorded JPEGs, although the tracker before took pixels.
    """
    folder = tmp_path_factory.mktemp("golden")
    run = write(folder / "run.mcap", FRAMES, [diagnosed(FRAMES[-1], "shm")])
    whole = folder / "golden.mcap"
    words = ["bag", "verify", run, "--node", "tracker", "--update", whole]
    with Program(words, folder, "update", forked=ZV) as program:
        assert program.process.wait(90) == 0, program.complaints
    assert DIFFERS not in program.complaints
    assert whole.stat().st_size < 700_000
    return whole


def records_of(path: Path) -> list[Record]:
    with Recording(path) as recording:
        return list(recording.records())


def tampered(golden: Path, path: Path, seq: int) -> Path:
    """Write the recording with another x and y of the first track of a frame."""
    records = records_of(golden)
    for number, record in enumerate(records):
        if record.key == KEY and record.header["seq"] == seq:
            fields = msgpack.unpackb(record.payload)
            fields["tracks"][0] |= {"x": 1.5, "y": 1.5}
            records[number] = replace(record, payload=msgpack.packb(fields))
    return write(path, records)


def test_a_node_that_was_started_again_is_named_with_the_time(golden: Path, tmp_path: Path, zv: Zv):
    path = tmp_path / "again.mcap"
    records = records_of(golden)
    (described,) = (each for each in records if each.key == "@vision/node/tracker_front")
    about = NodeDescription.from_bytes(described.payload)
    again = about.model_copy(update={"started_ns": records[0].log_time_ns + 750_000_000})
    end_ns = records[-1].log_time_ns
    write(path, records, [replace(described, payload=again.to_bytes(), log_time_ns=end_ns)])
    complaints = zv(path, "--node", "tracker").complaints
    assert "tracker_front was started again 0.75 s into the recording" in complaints
    assert complaints.count(DIFFERS) == 1


@pytest.mark.parametrize("command", ["", " ", "python 'sum.py"])
def test_what_is_no_command_is_refused(command: str):
    with pytest.raises(ConfigurationError, match="--command = "):
        load_settings(VerifyOptions, flags={"file": "a", "node": "sum", "command": command})


OTHER_PROCESSORS = f"{sys.executable} -m zv tracker --threads 2 --jpeg-threads 1"


@pytest.mark.parametrize("more", [(), ("--command", OTHER_PROCESSORS)], ids=["again", "elsewhere"])
def test_the_same_frames_give_the_same_results_also_on_other_processors(
    zv: Zv, golden: Path, more: tuple[str, ...]
):
    program = zv(golden, "--node", "tracker", "--json", *more)
    (line,) = program.output.splitlines()
    said = json.loads(line)
    assert (said["node"], said["same"], said["frames"]) == ("tracker_front", True, 45)
    assert said["messages"] > 2 * 45  # centroids, tracks, and events beside them
    assert DIFFERS not in program.complaints


def test_a_value_that_differs_is_named_with_frame_field_both_values_and_a_picture(
    zv: Zv, golden: Path, tmp_path: Path
):
    wrong = tampered(golden, tmp_path / "wrong.mcap", seq=40)
    program = zv(wrong, "--node", "tracker", "--json", status=1)
    said = json.loads(program.output)
    assert said["frame"]["seq"] == 40
    assert (said["key"], said["field"], said["recorded"]) == (KEY, "tracks.0.x", 1.5)
    assert said["frames"] == 40
    assert "frame 40 of front" in program.complaints
    assert f"{KEY}: tracks.0.x: recorded 1.5, now {said['now']}" in program.complaints
    picture = cv2.imread(str(tmp_path / "wrong.difference.png"))
    assert picture is not None
    assert picture.shape[0] > 240
    more = ["--tolerance", f"tracks.x={abs(said['now'] - 1.5) + 0.1}", "--ignore", "tracks.y"]
    zv(wrong, "--node", "tracker", *more)


def test_a_difference_is_said_too_where_its_picture_cannot_be_written(
    zv: Zv, golden: Path, tmp_path: Path
):
    wrong = tampered(golden, tmp_path / "wrong.mcap", seq=40)
    flags = ("--node", "tracker", "--picture", "none/there.png", "--json")
    program = zv(wrong, *flags, status=1)
    assert json.loads(program.output)["picture"] is None
    assert "tracker_front differs at frame 40 of front" in program.complaints
    assert "; no picture: none/there.png: No such file or directory" in program.complaints


def test_parameters_that_were_changed_during_the_run_are_changed_at_the_same_frame(
    zv: Zv, router: Router, service: Service, tmp_path: Path
):
    run = tmp_path / "run.mcap"
    with open_client(router.endpoint) as client:
        tracks = Listener(client, KEY)

        def until(revision: int) -> None:
            wait_until(lambda: sum(m.header["revision"] == revision for m in tracks.messages) > 10)

        service("tracker", "--camera", "front", "--transport", "jpeg")
        wait_for_nodes(client, "tracker_front")
        words = ["bag", "record", "--connect", router.endpoint, "-o", str(run)]
        with Program(words, tmp_path, "record", forked=ZV) as recorder:
            wait_for_subscriber(client, "@vision/param/tracker_front/min_area")
            service("camera", "--rate", 10)
            until(0)
            change = msgpack.packb({"min_area": 1_000_000})  # from now on nothing is an object
            assert all(r.ok for r in client.get("@vision/set/tracker_front", payload=change))
            until(1)
            written = run.with_name(run.name + PARTIAL)  # later than it arrived here
            wait_until(lambda: last_revision(written) == 1)
            assert recorder.interrupt() == 0
    changed = next(m for m in tracks.messages if m.header["revision"] == 1)
    said = json.loads(zv(run, "--node", "tracker", "--json").output)
    assert (said["same"], said["frames"] > 20) == (True, True)
    # The change is in the recording alone: without it, the first frame of another result differs.
    left = tmp_path / "left.mcap"
    change = msgpack.packb(1_000_000.0)
    kept = [
        each for each in records_of(run) if "/param/" not in each.key or change not in each.payload
    ]
    write(left, kept)
    difference = json.loads(zv(left, "--node", "tracker", "--json", status=1).output)
    assert difference["frame"]["seq"] >= changed.header["seq"]


def last_revision(path: Path) -> int:
    """Return the revision of the newest tracks in a recording that is being written."""
    with Recording(path) as recording:
        *_, newest = [-1, *(one.header["revision"] for one in recording.records(keys=(KEY,)))]
    return newest


@pytest.mark.parametrize("follow", [False, True])
def test_a_recording_may_end_between_the_messages_of_a_frame(
    zv: Zv, golden: Path, tmp_path: Path, follow: bool
):
    records = records_of(golden)
    last = max(record.header["seq"] for record in records if record.key == KEY)
    kept = []
    for record in records:
        of_node = record.header.get("node") == "tracker_front"
        seq = record.header.get("seq", 0) if of_node else 0
        if not ((seq == last - 1 and record.key != KEY) or (seq == last and not follow)):
            kept.append(record)
    cut = write(tmp_path / "cut.mcap", kept)
    program = zv(cut, "--node", "tracker", status=int(follow))
    if follow:
        assert f"differs at frame {last - 1} of front" in program.complaints
        assert "recorded missing" in program.complaints
    else:
        assert "the recording ends within the results of its last frame" in program.complaints


def test_frames_that_the_node_did_not_answer_are_left_out(zv: Zv, golden: Path, tmp_path: Path):
    kept = [
        each
        for each in records_of(golden)
        if each.header.get("node") != "tracker_front" or each.header["seq"] < 30
    ]
    changed = write(tmp_path / "changed.mcap", kept)
    assert "15 frames without a recorded result were left out" in (
        zv(changed, "--node", "tracker_front").output
    )


def test_a_recording_without_results_or_of_another_service_says_what_it_has(zv: Zv, tmp_path):
    run = write(tmp_path / "run.mcap", FRAMES[:3], centroids(FRAMES[:3]))
    assert "its nodes: camera_front, tracker_front" in (
        zv(run, "--node", "edge", status=1).complaints
    )
    bare = write(tmp_path / "bare.mcap", FRAMES[:3])
    assert "has nothing of tracker; its nodes: camera_front" in (
        zv(bare, "--node", "tracker", status=1).complaints
    )


def test_a_service_that_does_not_start_is_quoted(zv: Zv, golden: Path):
    said = zv(golden, "--node", "tracker", "--set", "min_area=-1", status=2).complaints
    assert "--min-area" in said
    said = zv(golden, "--node", "tracker", "--command", "false", status=1).complaints
    assert "tracker_front ended with status 1" in said
    said = zv(golden, "--node", "tracker", "--command", "no-such-program", status=1).complaints
    assert "no-such-program: No such file or directory" in said


def test_an_update_keeps_the_frames_and_never_overwrites(zv: Zv, golden: Path, tmp_path: Path):
    kept = [each for each in records_of(golden) if each.key.endswith("image/compressed")]
    assert [each.payload for each in kept] == [each.payload for each in FRAMES]
    assert [each.attachment for each in kept] == [each.attachment for each in FRAMES]
    said = zv(golden, "--node", "tracker", "--update", golden, status=3).complaints
    assert "exists already" in said


def test_what_a_tracker_says_of_an_epoch_after_the_first_message_of_the_next_one_is_kept(
    zv: Zv, tmp_path: Path
):
    later = [
        replace(
            each,
            attachment=msgpack.packb(
                {
                    **each.header,
                    "epoch": BEGIN_NS + LATER_NS,
                    "stamp_ns": each.header["stamp_ns"] + LATER_NS,
                }
            ),
            log_time_ns=each.log_time_ns + LATER_NS,
        )
        for each in FRAMES[:3]
    ]
    run = write(tmp_path / "run.mcap", FRAMES, later)
    zv(run, "--node", "tracker", "--update", "new.mcap")
    with Recording(tmp_path / "new.mcap") as recording:
        events = list(recording.records(keys=("vision/front/events",)))
    ended = [each for each in events if msgpack.unpackb(each.payload)["event"] == "ended"]
    assert [(each.header["epoch"], each.header["seq"]) for each in ended] == [(BEGIN_NS, 44)]
    assert "48 frames" in zv("new.mcap", "--node", "tracker").output


def test_an_update_onto_a_full_disk_says_so_and_leaves_no_file(golden: Path, tmp_path: Path):
    words = [sys.executable, "-m", "zv", "bag", "verify", golden, "--node", "tracker"]
    limited = ["sh", "-c", 'ulimit -f 100; exec "$@"', "sh"]
    done = run_program([*limited, *words, "--update", "new.mcap"], folder=tmp_path)
    assert (done.returncode, done.stderr) == (3, "zv: cannot write new.mcap: File too large\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("given", ["a file", "a flag"])
def test_a_model_is_found_beside_the_file_that_names_it(zv: Zv, tmp_path: Path, given: str):
    site = tmp_path / "site"
    site.mkdir()
    detector_models.save(site / "tiny.onnx", "yolov8")
    (site / "tracker.toml").write_text('pipeline = "detector"\nmodel = "tiny.onnx"\n')
    run = write(tmp_path / "run.mcap", FRAMES[:3])
    flags = ("--set", "pipeline=detector", "--set", "model=site/tiny.onnx")
    flags = ("--config", "site/tracker.toml") if given == "a file" else flags
    assert "3 frames" in zv(run, "--node", "tracker", *flags, "--update", "new.mcap").output


def test_a_wrong_setting_of_a_file_is_named_with_that_file(zv: Zv, golden: Path, tmp_path: Path):
    (tmp_path / "wrong.toml").write_text("min_area = -1\n")
    said = zv(golden, "--node", "tracker", "--config", "wrong.toml", status=2).complaints
    assert "wrong.toml: min_area" in said


@pytest.mark.parametrize("route", ["jpeg", "shm"])
def test_a_node_that_took_pixels_and_not_the_recorded_jpegs_is_said_to_differ(
    zv: Zv, tmp_path: Path, route: str
):
    few = FRAMES[:3]
    path = write(tmp_path / "run.mcap", few, centroids(few), [diagnosed(few[-1], route)])
    said = zv(path, "--node", "tracker", status=1).complaints  # whose results are others
    assert ("took its frames as pixels" in said) == (route == "shm")


def calibration() -> Record:
    """Return the calibration of a plane of 10 pixels a unit, published before the first frame."""
    key, first = "vision/front/camera_info", FRAMES[0]
    header = {name: value for name, value in first.header.items() if name != "encoding"}
    info = CameraInfo.model_validate(
        {
            "header": header,
            "width": header["width"],
            "height": header["height"],
            "distortion_model": "plumb_bob",
            "d": [0.0] * 5,
            "k": [100.0, 0, 50, 0, 100, 50, 0, 0, 1],
            "r": [1.0, 0, 0, 0, 1, 0, 0, 0, 1],
            "p": [100.0, 0, 50, 0, 0, 100, 50, 0, 0, 0, 1, 0],
            "plane": [0.1, 0, 0, 0, 0.1, 0, 0, 0, 1],
        }
    )
    at_ns = first.log_time_ns - 1
    encoding, attachment = msgpack_of(CameraInfo.schema_name), msgpack.packb(header)
    return Record(key, info.to_bytes(), encoding, attachment, log_time_ns=at_ns)


def test_a_recorded_calibration_holds_also_if_the_frame_behind_it_had_no_answer(
    zv: Zv, tmp_path: Path
):
    run = write(tmp_path / "run.mcap", [calibration()], FRAMES)
    zv(run, "--node", "tracker", "--update", "new.mcap")
    records = records_of(tmp_path / "new.mcap")
    said = [msgpack.unpackb(each.payload) for each in records if each.key == KEY]
    tracks = [track for message in said for track in message["tracks"]]
    assert tracks
    for track in tracks:  # the plane counts from the centre of the first pixel
        assert track["world"] == pytest.approx([(track["x"] - 0.5) / 10, (track["y"] - 0.5) / 10])
    earlier_ns = BEGIN_NS - LATER_NS
    header = {**FRAMES[0].header, "epoch": earlier_ns, "stamp_ns": earlier_ns}
    unanswered = replace(FRAMES[0], attachment=msgpack.packb(header), log_time_ns=earlier_ns)
    before = replace(calibration(), log_time_ns=earlier_ns - 1)
    rest = [each for each in records if not each.key.endswith("/camera_info")]
    write(tmp_path / "later.mcap", [before, unanswered], rest)
    said_of_it = zv("later.mcap", "--node", "tracker").output
    assert "45 frames" in said_of_it
    assert "1 frames without a recorded result were left out" in said_of_it


PAIRS = """
import os
from zenoh_vision import Connection, Node, Tracks, queue
with Node("pairs", connection=Connection(os.environ["ZV_CONNECT"]), publishes=["tracks"]) as node:
    frames, found = node.frames(buffering=queue(20)), node.messages("centroid")
    for frame, centroid in node.pairs(frames, found, tolerance_s=0):
        node.publish("tracks", Tracks(header=node.header(frame), tracks=()))
"""


COUNTS = """
import os, time
from zenoh_vision import Connection, Node, TrackEvent
with Node("counts", connection=Connection(os.environ["ZV_CONNECT"]), publishes=["events"]) as node:
    found, count = node.messages("centroid"), 0
    for frame in node.frames():
        while found.take(0.1) is not None:  # nor does one come a little later
            count += 1
        seen = TrackEvent(header=node.header(frame), event="seen", id=count, x=0.0, y=0.0)
        node.publish("events", seen)
"""


@pytest.mark.parametrize(
    ("node", "code", "topic", "fields", "after_ns"),
    [
        ("pairs", PAIRS, Tracks, lambda _: {"tracks": []}, 1),
        (
            "counts",
            COUNTS,
            TrackEvent,
            lambda number: {"event": "seen", "id": number, "x": 0.0, "y": 0.0},
            -1,
        ),
    ],
    ids=["that of this frame", "those before this frame"],
)
def test_a_service_of_frames_and_of_what_another_says_of_them_gets_both_in_their_order(
    zv: Zv, tmp_path: Path, node: str, code: str, topic: Any, fields: Any, after_ns: int
):
    few = FRAMES[:5]
    key = KEY if topic is Tracks else "vision/front/events"
    about = description(
        f"{node}_front",
        service=node,
        publishes=(key,),
        subscribes=("vision/front/image/compressed", "vision/front/centroid"),
    )
    described = Record(
        f"@vision/node/{node}_front",
        about.to_bytes(),
        msgpack_of(NodeDescription.schema_name),
        log_time_ns=BEGIN_NS,
        origin="query",
    )
    answers = []
    for number, each in enumerate(centroids(few)):  # the tracker's
        header = each.header | {"node": f"{node}_front"}
        answers.append(
            Record(
                key,
                msgpack.packb({"header": header, **fields(number)}),
                msgpack_of(topic.schema_name),
                msgpack.packb(header),
                log_time_ns=each.log_time_ns + after_ns,
            )
        )
    run = write(tmp_path / "run.mcap", [described], few, centroids(few), answers)
    service = tmp_path / "service.py"
    service.write_text(code)
    command = f"{sys.executable} {service}"
    said = zv(run, "--node", node, "--command", command, "--answer", "5s").output
    assert "5 frames, 5 messages as recorded" in said
