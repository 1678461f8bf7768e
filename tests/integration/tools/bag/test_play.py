"""``zv bag play``: what subscribers get, and how it is controlled."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
import zenoh

from tests.integration.conftest import Service
from tests.support.fork_server import ZV
from tests.support.listening import Listener, Message, open_client
from tests.support.pictures.encoded import HEIGHT, WIDTH
from tests.support.processes import Program
from tests.support.recordings import centroids, frames, write
from tests.support.routing import Router
from tests.support.terminal import Terminal
from tests.support.typist import zv
from tests.support.waiting import wait_until
from zenoh_vision import Centroid, Frame, Node, TrackEvent
from zenoh_vision.testing import at
from zv.bag.record import Record

FRAMES = frames(12)
RESULTS = centroids(FRAMES)
LOSSLESS = ("--speed", "0")
"""At a pace, frames are dropped where a link is full, as those of a camera are."""
MARK = {"replay", "replayed_ns"}


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Twelve frames and their centroids, 0.4 s."""
    return write(tmp_path / "run.mcap", FRAMES, RESULTS)


Play = Callable[..., Program]


@pytest.fixture
def client(router: Router) -> Iterator[zenoh.Session]:
    with open_client(router.endpoint) as session:
        yield session


@pytest.fixture
def play(router: Router, tmp_path: Path) -> Iterator[Play]:
    """``play(recording, "--loop")`` starts it."""
    programs: list[Program] = []

    def start(file: Path, *flags: str) -> Program:
        words = ["bag", "play", str(file), "--connect", router.endpoint, *flags]
        programs.append(Program(words, tmp_path, f"play{len(programs)}", forked=ZV))
        return programs[-1]

    yield start
    for program in programs:
        program.__exit__(None, None, None)


def set_parameter(router: Router, name: str, value: str, node: str = "player_front") -> None:
    done = zv(router.endpoint, "param", "set", node, f"{name}={value}")
    assert done.returncode == 0, done.stderr


def all_of(listener: Listener, count: int) -> list[Message]:
    """Return the messages of a replay that has ended, when there are so many."""

    def there() -> str:
        return str(sorted((each.header["seq"], each.key) for each in listener.messages))

    wait_until(lambda: len(listener.messages) >= count, explain=there)
    return listener.messages


def ended(program: Program, status: int = 0) -> str:
    assert program.process.wait(30) == status, program.complaints
    return program.complaints


def test_keys_bytes_and_attachments_are_those_that_were_recorded(client, play, recording):
    listener = Listener(client, "vision/**")
    ended(play(recording, *LOSSLESS))
    found = {(each.key, each.header["seq"]): each for each in all_of(listener, 24)}
    for record in (*FRAMES, *RESULTS):
        got = found.pop((record.key, record.header["seq"]))
        assert (got.payload, got.encoding) == (record.payload, record.encoding)
        assert {name: got.header[name] for name in record.header} == record.header
        assert got.header.keys() - record.header.keys() == MARK
    assert not found


def test_unmarked_attachments_are_the_same_to_the_byte(client, play, recording):
    listener = Listener(client, "vision/**")
    ended(play(recording, *LOSSLESS, "--unmarked"))
    sent = {(each.key, each.attachment) for each in all_of(listener, 24)}
    assert sent == {(each.key, each.attachment) for each in (*FRAMES, *RESULTS)}


def test_a_part_is_played_as_another_camera_in_another_namespace(client, play, recording):
    listener = Listener(client, "**")
    flags = (*LOSSLESS, "--start", "100ms", "--end", "300ms", "--as", "left", "--namespace", "lab")
    ended(play(recording, *flags, "--exclude", "**/centroid"))
    got = [each for each in listener.messages if not each.key.startswith("@")]
    assert {each.key for each in got} == {"lab/left/image/compressed"}
    assert [each.header["seq"] for each in got] == [3, 4, 5, 6, 7, 8]
    assert {each.header["camera"] for each in got} == {"left"}


def test_renewed_stamps_are_of_now_and_join_frames_and_results(client, play, recording):
    begun_ns = time.time_ns()
    listener = Listener(client, "vision/front/**")
    ended(play(recording, *LOSSLESS, "--now"))
    stamps: dict[int, set[int]] = {}
    for each in all_of(listener, 24):
        assert MARK.isdisjoint(each.header)
        stamps.setdefault(each.header["seq"], set()).add(each.header["stamp_ns"])
        if each.key.endswith("centroid"):
            stamps[each.header["seq"]].add(each.body["header"]["stamp_ns"])
    assert [len(found) for found in stamps.values()] == [1] * 12
    assert begun_ns - 10**9 < min(min(found) for found in stamps.values())


def test_it_does_not_play_beside_a_live_camera_of_that_name(play, service: Service, recording):
    camera = service("camera", "--camera", "front")
    wait_until(lambda: "synthetic" in camera.complaints)
    said = ended(play(recording), status=1)
    assert "camera_front (pid" in said
    assert "publishes vision/front/image/compressed" in said
    assert "--as NAME" in said


def test_it_pauses_when_a_live_camera_of_that_name_starts(client, play, service, recording):
    listener = Listener(client, "vision/front/image/compressed")
    program = play(recording, "--loop")
    listener.wait_for(3)
    service("camera", "--camera", "front", "--source", "synthetic")
    wait_until(lambda: "paused: camera_front" in program.complaints)
    at_s = time.monotonic()
    live = [each for each in listener.wait_for(5, after_s=at_s) if not MARK & set(each.header)]
    assert len(live) >= 4  # one was perhaps on its way


def test_results_that_a_live_node_publishes_are_not_played(client, play, service, recording):
    service("tracker", "--camera", "front")
    listener = Listener(client, "vision/front/centroid")
    said = ended(play(recording, "--lockstep", "tracker_front"))
    assert "tracker_front publishes vision/front/centroid now" in said
    got = listener.wait_for(12)
    assert [each.header["seq"] for each in got] == list(range(12))
    assert all("received_ns" in each.header for each in got)  # the recorded ones have none


@contextmanager
def own_node(
    router: Router, topic: str, run: Callable[[Node], None], camera: str = "front"
) -> Iterator[None]:
    """Run a node ``own_CAMERA`` that publishes a topic, on a thread of its own."""
    with Node("own", camera=camera, connection=at(router.endpoint), publishes=[topic]) as node:
        thread = threading.Thread(target=run, args=[node])
        thread.start()
        yield
        node.stop()
        thread.join(10)


def answer(node: Node, frame: Frame) -> None:
    nothing = Centroid(header=node.header(frame), x=None, y=None, box=None, area=None)
    node.publish("centroid", nothing)


def test_in_lockstep_a_slow_node_gets_every_frame(play, router: Router, recording):
    got: list[int] = []

    def run(node: Node) -> None:
        for frame in node.frames(want="gray"):
            time.sleep(0.1)  # three frames of the recording
            got.append(frame.header.seq)
            answer(node, frame)

    with own_node(router, "centroid", run):
        ended(play(recording, "--lockstep", "own_front"))
    assert got == list(range(12))


def as_raw(frame: Record) -> Record:
    """Return the raw form of a frame, which arrived 1 ms before it."""
    return replace(
        frame,
        key=frame.key.removesuffix("/compressed"),
        payload=bytes(WIDTH * HEIGHT * 3),
        encoding="application/octet-stream;vision.Image.v1",
        log_time_ns=frame.log_time_ns - 10**6,
    )


def test_in_lockstep_a_frame_that_was_recorded_in_two_forms_is_answered_once(
    play, router: Router, tmp_path: Path
):
    recording = write(tmp_path / "both.mcap", [as_raw(each) for each in FRAMES], FRAMES)
    got: list[int] = []

    def run(node: Node) -> None:
        for frame in node.frames(want="gray", transport="jpeg"):
            got.append(frame.header.seq)
            answer(node, frame)

    with own_node(router, "centroid", run):
        ended(play(recording, "--lockstep", "own_front", "--answer", "5s"))
    assert got == list(range(12))


def test_in_lockstep_the_forms_of_a_frame_may_stand_around_those_of_another_camera(
    play, router: Router, tmp_path: Path
):
    cameras = {name: frames(12, camera=name) for name in ("front", "left")}
    raw = [as_raw(each) for name in cameras for each in cameras[name]]
    recording = write(tmp_path / "both.mcap", raw, *cameras.values())
    got: dict[str, list[int]] = {name: [] for name in cameras}

    def run(node: Node) -> None:
        for frame in node.frames(want="gray", transport="jpeg"):
            got[node.camera].append(frame.header.seq)
            answer(node, frame)

    names = [f"own_{name}" for name in cameras]
    with ExitStack() as running:
        for name in cameras:
            running.enter_context(own_node(router, "centroid", run, camera=name))
        ended(play(recording, "--lockstep", ",".join(names), "--answer", "5s"))
    assert got == {name: list(range(12)) for name in cameras}


def test_in_lockstep_a_node_that_pairs_frames_with_recorded_results_gets_both(
    play, router: Router, recording
):
    got: list[tuple[int, int]] = []

    def run(node: Node) -> None:
        # The player waits for one who takes frames, so the centroids are subscribed to before.
        inputs = node.messages("centroid"), node.frames(want="gray")
        for centroid, frame in node.pairs(*inputs, tolerance_s=0):
            got.append((frame.header.seq, centroid.header.seq))
            header = node.header(frame)
            node.publish("events", TrackEvent(header=header, event="seen", id=1, x=0.0, y=0.0))

    with own_node(router, "events", run):
        ended(play(recording, "--lockstep", "own_front", "--answer", "5s"))
    assert got == [(seq, seq) for seq in range(12)]


def test_in_lockstep_a_node_may_say_more_of_an_earlier_frame_after_its_answer(
    play, router: Router, recording
):
    got: list[int] = []

    def run(node: Node) -> None:
        before: Frame | None = None
        for frame in node.frames(want="gray"):
            got.append(frame.header.seq)
            answer(node, frame)
            if before is not None:
                answer(node, before)
            before = frame

    with own_node(router, "centroid", run):
        ended(play(recording, "--lockstep", "own_front", "--answer", "5s", "--speed", "1"))
    assert got == list(range(12))


def test_lockstep_names_the_node_that_does_not_run_or_has_gone(play, recording, service):
    said = ended(play(recording, "--lockstep", "tracker_front", "--timeout", "1s"), status=1)
    assert "tracker_front does not run; nodes that run: player_front" in said


def test_paused_it_sends_a_frame_and_its_results_at_each_step(client, play, router, recording):
    listener = Listener(client, "vision/front/**")
    program = play(recording, *LOSSLESS, "--step")
    wait_until(lambda: "playing" in program.complaints)
    for step in (1, 2):
        set_parameter(router, "step", str(step))
        got = listener.wait_for(2 * step)
        assert [each.header["seq"] for each in got] == [0, 0, 1, 1][: 2 * step]
    set_parameter(router, "position", "0.3")  # frame 9 is the first that arrived after it
    set_parameter(router, "paused", "false")
    ended(program)
    jumped = listener.messages[4:]
    assert [each.header["seq"] for each in jumped if each.key.endswith("compressed")] == [9, 10, 11]
    assert len({each.header["replay"] for each in listener.messages}) == 2


def test_a_consumer_drops_nothing_of_a_slow_replay_that_begins_again(
    client, play, service, recording
):
    service("tracker", "--camera", "front")
    listener = Listener(client, "vision/front/centroid")
    program = play(recording, "--loop", "--speed", "0.5", "--exclude", "**/centroid")
    got = listener.wait_for(30)
    assert program.interrupt() == 0
    runs = [(each.header["replay"], each.header["seq"]) for each in got]
    assert runs == sorted(runs)
    assert len({run for run, _ in runs}) >= 2


def test_keys_of_a_terminal_step_jump_and_end_it(client, router: Router, recording: Path):
    listener = Listener(client, FRAMES[0].key)
    words = ["bag", "play", str(recording), "--step", "--connect", router.endpoint]
    terminal = Terminal(words)
    terminal.until(lambda text: "space: pause" in text)
    terminal.press(b"s")
    listener.wait_for(1)
    terminal.press(b"s")
    assert [each.header["seq"] for each in listener.wait_for(2)] == [0, 1]
    terminal.press(b"0")  # a jump while paused shows the frame that is there
    assert listener.wait_for(3)[2].header["seq"] == 0
    terminal.press(b"q")
    assert terminal.end() == 0


def test_a_key_of_a_terminal_ends_the_wait_for_the_last_answers(router: Router, recording: Path):
    seen: list[int] = []

    def run(node: Node) -> None:
        for frame in node.frames(want="gray"):
            seen.append(frame.header.seq)
            if frame.header.seq < 11:
                answer(node, frame)

    with own_node(router, "centroid", run):
        words = ["bag", "play", str(recording), "--lockstep", "own_front"]
        terminal = Terminal([*words, "--connect", router.endpoint])
        wait_until(lambda: 11 in seen, explain=lambda: terminal.text)
        terminal.press(b"q")
        assert terminal.end() == 0


def test_a_query_gets_the_newest_frame_that_was_played(client, play, router, recording):
    program = play(recording, "--step")
    wait_until(lambda: "playing" in program.complaints)
    assert not list(client.get(FRAMES[0].key))
    set_parameter(router, "step", "1")

    def newest() -> list[bytes]:
        replies = [reply.ok for reply in client.get(FRAMES[0].key)]
        return [sample.payload.to_bytes() for sample in replies if sample is not None]

    assert wait_until(newest) == [FRAMES[0].payload]


@pytest.mark.parametrize(
    ("flags", "status", "words"),
    [
        (["--as", "a=b"], 2, "cameras of the recording: front"),
        (["--as", "a,b"], 2, "several cameras need OLD=NEW"),
        (["--as", "front=a,front=b"], 2, "camera front gets two names: a and b"),
        (["--start", "9s"], 2, "the recording is 0.4 s long"),
        (["--start", "2s", "--end", "1s"], 2, "--end 1 s is not after --start 2 s"),
        (["--keys", "lab/**"], 1, "its keys: vision/front/centroid"),
        (["--keys", "a//b"], 2, "not a key expression"),
        (["--speed", "-1"], 2, "0 to 100"),
        (["--now", "--unmarked"], 2, "give --now or --unmarked"),
        (["--lockstep", "A"], 2, "--lockstep"),
    ],
)
def test_wrong_use_names_what_is_allowed(play, recording, flags, status, words):
    assert words in ended(play(recording, *flags), status=status)


def test_two_cameras_are_not_played_under_one_name(play, tmp_path: Path):
    recorded = write(tmp_path / "two.mcap", FRAMES, frames(12, camera="left"))
    words = "cameras front and left would both be played as front"
    assert words in ended(play(recorded, "--as", "left=front"), status=2)
    ended(play(recorded, *LOSSLESS, "--as", "left=front,front=left"))


def test_no_recording_is_an_error_of_the_file(play, tmp_path: Path):
    assert "No such file" in ended(play(tmp_path / "none.mcap"), status=3)
    other = tmp_path / "other.mcap"
    other.write_bytes(b"not one")
    assert "not an MCAP file" in ended(play(other), status=3)
