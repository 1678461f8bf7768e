"""The tools there are. A new one is a folder and an entry here; its command follows from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Tool:
    """One command of a tool.

    Attributes:
        options: Module and class of its options, a ``ToolOptions``.
        run: Module and function that is called with (options, connection, output).
        line: What it does, for the list of commands.
        example: Command lines that show its use.
        details: More of its help, behind the line.
        json: Whether it has ``--json``.
        section: The heading that it stands under in ``zv --help``.
        waits: Whether it waits for a router for ever, as a service does, unless told.
    """

    options: str
    run: str
    line: str
    example: str
    details: str = ""
    json: bool = True
    section: str = "Tools"
    waits: bool = False


GROUPS: Final[dict[str, str]] = {
    "topic": "See, measure and send what flows on key expressions.",
    "node": "See which nodes run and what each does.",
    "param": "Read, set, save and load the parameters of nodes that run.",
}
"""Commands that have commands of their own, with their line in ``zv --help``."""

TOOLS: Final[dict[str, Tool]] = {
    "topic list": Tool(
        "services.tools.topic.options:ListOptions",
        "services.tools.topic.listing:run",
        "List keys: type, encoding, publishers, subscribers, rate.",
        "zv topic list  |  zv topic list 'vision/*/centroid' --watch",
        "Watches for a second what flows, and does not make flow what is made on demand only; "
        "--all does. Subscribers are counted without this command.",
    ),
    "topic info": Tool(
        "services.tools.topic.options:InfoOptions",
        "services.tools.topic.info:run",
        "Say all that is known of a key: who sends and gets it, its newest message.",
        "zv topic info vision/front/image/compressed",
    ),
    "topic echo": Tool(
        "services.tools.topic.options:EchoOptions",
        "services.tools.topic.echo:run",
        "Print messages as they come; of a picture its header, size and format.",
        "zv topic echo vision/front/centroid --once  |  "
        "zv topic echo vision/front/centroid --field x --csv > x.csv",
        "A field of a field has a dotted name: header.seq, box.2, tracks.id. Where nothing comes "
        "for a second, the newest message there is is shown.",
    ),
    "topic hz": Tool(
        "services.tools.topic.options:HzOptions",
        "services.tools.topic.measuring:run_hz",
        "Show message rates, or check them.",
        "zv topic hz vision/front/centroid  |  zv topic hz --expect 30 --tolerance 10% --for 5s",
        "min, max, std, p50 and p99 are of the times between messages, over the window. lost "
        "counts the frames of the camera that never came here, since the start.",
    ),
    "topic bw": Tool(
        "services.tools.topic.options:BwOptions",
        "services.tools.topic.measuring:run_bw",
        "Show bandwidths, or check them.",
        "zv topic bw 'vision/*/image/compressed'  |  zv topic bw --expect 1.5MB/s --for 5s",
        "min, max, std, p50 and p99 are of the payloads' sizes, over the window.",
    ),
    "topic delay": Tool(
        "services.tools.topic.options:DelayOptions",
        "services.tools.topic.measuring:run_delay",
        "Show delays from capture to arrival, or check them.",
        "zv topic delay vision/front/centroid  |  zv topic delay --at-most 50ms --for 5s",
        "By the stamp in the header and this machine's clock: on two machines the difference of "
        "their clocks is in it. Samples without a header have no delay.",
    ),
    "topic pub": Tool(
        "services.tools.topic.options:PubOptions",
        "services.tools.topic.pub:run",
        "Send a message or an image file, once or at a rate.",
        "zv topic pub vision/front/image/compressed photo.jpg --rate 10  |  "
        """zv topic pub vision/front/centroid '{"x": 1, "y": 2, "box": null, "area": null}'""",
        "The key says which type a message has, and it is checked against that. Its header is "
        "made anew for each message: epoch, number and stamp cannot be given.",
        json=False,
    ),
    "node list": Tool(
        "services.tools.node.options:ListOptions",
        "services.tools.node.listing:run",
        "List the nodes that run.",
        "zv node list  |  zv node list --watch",
        "By their liveliness tokens: one that was killed is gone at once, one that froze or lost "
        "its network after 2 s. Two nodes of one name are two lines.",
    ),
    "node info": Tool(
        "services.tools.node.options:InfoOptions",
        "services.tools.node.info:run",
        "Say all that a node says of itself.",
        "zv node info tracker_front  |  zv node info 'camera_*' --json",
        "What it publishes and subscribes, its parameters, version, host, process, uptime, health.",
    ),
    "param list": Tool(
        "services.tools.param.options:ListOptions",
        "services.tools.param.commands:list_",
        "Show the parameters of a node, or of all nodes.",
        "zv param list tracker_front",
    ),
    "param get": Tool(
        "services.tools.param.options:NamedOptions",
        "services.tools.param.commands:get",
        "Print the value of a parameter.",
        "zv param get camera_front quality",
        "One is printed alone, several with their names.",
    ),
    "param set": Tool(
        "services.tools.param.options:SetOptions",
        "services.tools.param.commands:set_",
        "Set parameters, all or none.",
        "zv param set edge_front low=30 high=90",
        "In force with the next frame. It is lost when the node ends, unless saved by dump.",
    ),
    "param describe": Tool(
        "services.tools.param.options:NamedOptions",
        "services.tools.param.commands:describe",
        "Say what a parameter is for, its range, unit and default.",
        "zv param describe tracker_front closing",
    ),
    "param dump": Tool(
        "services.tools.param.options:DumpOptions",
        "services.tools.param.commands:dump",
        "Write the parameters of a node as the TOML that --config reads.",
        "zv param dump tracker_front -o tracker.toml",
    ),
    "param load": Tool(
        "services.tools.param.options:LoadOptions",
        "services.tools.param.commands:load",
        "Send the values of a TOML file to a node, all or none.",
        "zv param load tracker_front tracker.toml",
    ),
    "snapshot": Tool(
        "services.tools.snapshot.options:SnapshotOptions",
        "services.tools.snapshot.saving:run",
        "Save the newest picture of a key.",
        "zv snapshot vision/front/image/compressed -o frame.jpg  |  "
        "zv snapshot vision/front/image/compressed --draw -o drawn.png",
        "It is saved as it came, if the file's name allows. Raw pictures go to JPEG or PNG, those "
        "of 16 bits to PNG only. Its age and identity go to standard error. --draw waits for a "
        "picture and the result of the same frame, joined by epoch and seq.",
    ),
    "schema": Tool(
        "services.tools.schema.options:SchemaOptions",
        "services.tools.schema.printing:run",
        "Print the JSON Schema of a message, or list the messages.",
        "zv schema  |  zv schema Centroid",
        "Made from the message's class, without a network; a running node answers the same on "
        "@{ns}/schema/{name}.",
    ),
    "top": Tool(
        "services.tools.top.options:TopOptions",
        "services.tools.top.command:run",
        "Watch all nodes: rates, latencies, losses, those that hurt first.",
        "zv top  |  zv top --once  |  zv top --once --json",
        "Sorted by level, then by the share of frames lost in the last 5 s, then by latency. CPU "
        "and memory are shown of the nodes on this machine.",
    ),
    "doctor": Tool(
        "services.tools.doctor.options:DoctorOptions",
        "services.tools.doctor.command:run",
        "Find what is wrong, and say what to do about it.",
        "zv doctor  |  zv doctor --namespace lab --for 10s  |  zv doctor my-camera.toml",
        "A line for each thing that was checked: OK, WARN or FAIL. Exit status 1 if one is FAIL, 4 "
        "if that is only the router. docs/doctor.md says what each check means.",
    ),
    "metrics": Tool(
        "services.tools.metrics.options:MetricsOptions",
        "services.tools.metrics.command:run",
        "Serve the health of all nodes to Prometheus.",
        "zv metrics --listen 127.0.0.1:9464",
        details="Prints the address that Prometheus scrapes and serves it until Ctrl-C, whether "
        "or not there is a router. docs/metrics.md says what is served.",
        waits=True,
    ),
}
"""Every tool by what one types behind ``zv``: ``snapshot``, ``topic hz``."""
