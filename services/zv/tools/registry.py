"""The tools. A new tool needs a folder and an entry here, from which its command is made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Tool:
    """One command of a tool.

    Attributes:
        options: Module and class of its options, a subclass of ``ToolOptions``.
        run: Module and function, called with (options, connection, output).
        example: Command lines that show its use, one per line.
        details: The help text below the summary.
        json: Whether it has ``--json``.
        waits: Whether it waits for a router without limit by default, as a service does.
        completes: Kinds of its positional arguments, for completion from the running system:
            ``key``, ``node``, ``parameter``, ``value``; ``...`` where the last ones repeat.
    """

    options: str
    run: str
    summary: str
    example: str
    details: str = ""
    json: bool = True
    waits: bool = False
    completes: tuple[str, ...] = ()


GROUPS: Final[dict[str, str]] = {
    "topic": "Inspect, measure and publish data on key expressions.",
    "node": "List running nodes and show their details.",
    "param": "Read, set, save and load the parameters of running nodes.",
    "calibrate": "Calibrate a camera: its lens, and the plane that it looks at.",
    "new": "Write the files of a service of your own.",
}
"""Commands that have commands of their own, with their summaries."""

TOOLS: Final[dict[str, Tool]] = {
    "topic list": Tool(
        "zv.tools.topic.options:ListOptions",
        "zv.tools.topic.list:run",
        "List keys: type, encoding, publishers, subscribers, rate.",
        "zv topic list\nzv topic list 'vision/*/centroid' --watch",
        "Listens for one second, without starting streams that are produced on demand; --all "
        "starts them too. This command is not counted among the subscribers.",
        completes=("key",),
    ),
    "topic info": Tool(
        "zv.tools.topic.options:InfoOptions",
        "zv.tools.topic.info:run",
        "Show a key's type, publishers, subscribers and newest message.",
        "zv topic info vision/front/image/compressed",
        completes=("key",),
    ),
    "topic echo": Tool(
        "zv.tools.topic.options:EchoOptions",
        "zv.tools.topic.echo:run",
        "Print messages as they arrive; for a picture its header, size and format.",
        "zv topic echo vision/front/centroid --once\n"
        "zv topic echo vision/front/centroid --field header.seq --field x --csv > x.csv",
        "Nested fields have dotted names: header.seq, box.2, tracks.id. --field may be given "
        "several times; a message without such a field is skipped and counted. If nothing arrives "
        "for a second, the newest message is shown.",
        completes=("key",),
    ),
    "topic hz": Tool(
        "zv.tools.topic.options:HzOptions",
        "zv.tools.topic.measure:run_hz",
        "Show message rates, or check them.",
        "zv topic hz vision/front/centroid\nzv topic hz --expect 30 --tolerance 10% --for 5s",
        "min, max, std, p50 and p99 describe the times between messages, over the window. lost "
        "counts the camera's frames that have not arrived here since the start.",
        completes=("key", "..."),
    ),
    "topic bw": Tool(
        "zv.tools.topic.options:BwOptions",
        "zv.tools.topic.measure:run_bw",
        "Show bandwidths, or check them.",
        "zv topic bw 'vision/*/image/compressed'\nzv topic bw --expect 1.5MB/s --for 5s",
        "min, max, std, p50 and p99 describe the sizes of the payloads, over the window.",
        completes=("key", "..."),
    ),
    "topic delay": Tool(
        "zv.tools.topic.options:DelayOptions",
        "zv.tools.topic.measure:run_delay",
        "Show delays from capture to arrival, or check them.",
        "zv topic delay vision/front/centroid\nzv topic delay --at-most 50ms --for 5s",
        "Measured from the stamp in the header by this machine's clock; between two machines it "
        "includes the difference of their clocks. Samples without a header have no delay.",
        completes=("key", "..."),
    ),
    "topic pub": Tool(
        "zv.tools.topic.options:PubOptions",
        "zv.tools.topic.pub:run",
        "Publish a message or an image file, once or at a rate.",
        "zv topic pub vision/front/image/compressed photo.jpg --rate 10\n"
        """zv topic pub vision/front/centroid '{"x": 1, "y": 2, "box": null, "area": null}'""",
        "The key determines the type that the message is checked against. Each message gets a "
        "new header: epoch, number and stamp cannot be given. The first message waits up to a "
        "second for a subscriber; with --once or --wait-for N, without a time limit.",
        json=False,
        completes=("key", ""),
    ),
    "node list": Tool(
        "zv.tools.node.options:ListOptions",
        "zv.tools.node.listing:run",
        "List the running nodes.",
        "zv node list\nzv node list --watch",
        "Nodes are found by their liveliness tokens: a killed node disappears at once, one that "
        "froze or lost its network after 2 s. Two nodes with the same name are two lines.",
    ),
    "node info": Tool(
        "zv.tools.node.options:InfoOptions",
        "zv.tools.node.info:run",
        "Show the description of a node.",
        "zv node info tracker_front\nzv node info 'camera_*' --json",
        "Shows its keys, parameters, version, host, process, uptime and health.",
        completes=("node",),
    ),
    "param list": Tool(
        "zv.tools.param.options:ListOptions",
        "zv.tools.param.commands:list_",
        "Show the parameters of a node, or of all nodes.",
        "zv param list tracker_front",
        completes=("node",),
    ),
    "param get": Tool(
        "zv.tools.param.options:NamedOptions",
        "zv.tools.param.commands:get",
        "Print the value of a parameter.",
        "zv param get camera_front quality",
        "A single value is printed alone, several with their names.",
        completes=("node", "parameter", "..."),
    ),
    "param set": Tool(
        "zv.tools.param.options:SetOptions",
        "zv.tools.param.commands:set_",
        "Set parameters, all or none on each node.",
        "zv param set edge_front low=30 high=90\nzv param set 'camera_*' quality 60",
        "A change takes effect with the next frame, and is lost when the node ends: dump saves it. "
        "A pattern sets each node that matches; if one refuses, the others are set, and the exit "
        "status is 2.",
        completes=("node", "parameter", "value", "..."),
    ),
    "param describe": Tool(
        "zv.tools.param.options:NamedOptions",
        "zv.tools.param.commands:describe",
        "Show the meaning, range, unit and default of a parameter.",
        "zv param describe tracker_front closing",
        completes=("node", "parameter", "..."),
    ),
    "param dump": Tool(
        "zv.tools.param.options:DumpOptions",
        "zv.tools.param.commands:dump",
        "Write the parameters of a node as the TOML that --config reads.",
        "zv param dump tracker_front -o tracker.toml",
        completes=("node",),
    ),
    "param load": Tool(
        "zv.tools.param.options:LoadOptions",
        "zv.tools.param.commands:load",
        "Send the values of a TOML file to a node, all or none.",
        "zv param load tracker_front tracker.toml",
        completes=("node", ""),
    ),
    "snapshot": Tool(
        "zv.tools.snapshot.options:SnapshotOptions",
        "zv.tools.snapshot.command:run",
        "Save the newest picture of a key.",
        "zv snapshot vision/front/image/compressed -o frame.jpg\n"
        "zv snapshot vision/front/image/compressed --draw -o drawn.png",
        "Saved unchanged if it has the format of the file's name. Raw pictures are saved as JPEG "
        "or PNG, 16-bit pictures as PNG only. Age and identity are printed to standard error. "
        "--draw waits for a picture and the result of the same frame, matched by epoch and seq.",
        completes=("key",),
    ),
    "schema": Tool(
        "zv.tools.schema.options:SchemaOptions",
        "zv.tools.schema.command:run",
        "Print the JSON Schema of a message, or list the messages.",
        "zv schema\nzv schema Centroid",
        "Those of this project need no network. Those of other programs are queried from their "
        "running nodes, on @{ns}/schema/{name}; a list has them if a router is reached within 1 s.",
    ),
    "new service": Tool(
        "zv.tools.new.options:ServiceOptions",
        "zv.tools.new.service:run",
        "Write a service of your own: settings, loop, launch file and test.",
        "zv new service brightness",
        "Writes a folder with NAME.py, launch.toml and test_NAME.py, a complete service to change. "
        "Needs no router; nothing is overwritten.",
    ),
    "calibrate camera": Tool(
        "zv.tools.calibrate.options:CameraOptions",
        "zv.tools.calibrate.camera:run",
        "Find a camera's lens from pictures of a board.",
        "zv calibrate camera --size 9x6 --square 25 -o front.yaml\n"
        "zv calibrate camera --images boards --size 9x6 --square 25 -o front.yaml",
        "Move the board through the whole picture, near and tilted, and hold it still; what is "
        "still missing is printed for each picture that is taken. Ends when there are enough "
        "pictures, and writes a file that ROS' camera_info_manager reads too. If the pictures are "
        "too poor, exit status 1 and no file. With --images no router is needed.",
    ),
    "calibrate plane": Tool(
        "zv.tools.calibrate.options:PlaneOptions",
        "zv.tools.calibrate.plane:run",
        "Find the homography from a camera's pixels to a plane in the world.",
        "zv calibrate plane front.yaml --pairs belt.txt\n"
        "zv calibrate plane front.yaml --size 9x6 --square 25",
        "Takes four or more pixels and their places on the plane, in any unit, or a board that "
        "lies on it; its first inner corner is then the origin. Without a board no router is "
        "needed. If they do not determine a plane, exit status 1, and FILE is not changed.",
    ),
    "top": Tool(
        "zv.tools.top.options:TopOptions",
        "zv.tools.top.command:run",
        "Show rates, latencies and losses of all nodes, the worst first.",
        "zv top\nzv top --once\nzv top --once --json",
        "Sorted by level, then by the share of frames lost in the last 5 s, then by latency. CPU "
        "and memory are shown for the nodes on this machine.",
    ),
    "doctor": Tool(
        "zv.tools.doctor.options:DoctorOptions",
        "zv.tools.doctor.command:run",
        "Find problems and suggest remedies.",
        "zv doctor\nzv doctor --namespace lab --for 10s\nzv doctor --expect my-system.toml",
        "Prints a line for each check: OK, WARN or FAIL. Exit status 1 if one is FAIL, 4 if only "
        "the router is. --expect also reports the nodes of a launch file that do not run.",
    ),
    "metrics": Tool(
        "zv.tools.metrics.options:MetricsOptions",
        "zv.tools.metrics.command:run",
        "Serve the health of all nodes to Prometheus.",
        "zv metrics --listen 127.0.0.1:9464",
        details="Prints the address that Prometheus scrapes, and serves the metrics there until "
        "Ctrl-C, with or without a router. Each metric has a line of explanation.",
        waits=True,
    ),
}
"""The tools by their command behind ``zv``: ``snapshot``, ``topic hz``."""
