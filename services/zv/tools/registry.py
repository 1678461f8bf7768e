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
    "node": "List running nodes, show their details, stop and start those of zv up.",
    "param": "Read, set, save and load the parameters of running nodes.",
    "bag": "Record what is on the network, play it again, and verify results.",
    "calibrate": "Calibrate a camera: its lens, and the plane that it looks at.",
    "new": "Write the files of a service of your own.",
    "security": "Certificates and rights: who may see, publish and set what.",
}
"""Commands that have commands of their own, with their summaries."""

PLAYER_KEYS: Final = (
    "space pauses, s steps, left and right move by 5 s, up and down double and halve the speed, "
    "0 goes to the beginning, q quits."
)

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
        "zv topic echo vision/front/centroid --field header.seq --field x --csv > x.csv\n"
        "zv topic echo vision/front/tracked/compressed --image",
        "Nested fields have dotted names: header.seq, box.2, tracks.id. --field may be given "
        "several times; a message without such a field is skipped and counted. If nothing arrives "
        "for a second, the newest message is shown. --image draws pictures in the terminal, also "
        "over ssh: by Kitty's protocol, as Sixel, or with block characters.",
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
    "node stop": Tool(
        "zv.tools.node.options:ControlOptions",
        "zv.tools.node.control:stop",
        "Stop a node that zv up runs.",
        "zv node stop edge_front",
        "It gets SIGTERM, and SIGKILL after the launch file's grace; zv up then leaves it stopped.",
        completes=("node",),
    ),
    "node start": Tool(
        "zv.tools.node.options:ControlOptions",
        "zv.tools.node.control:start",
        "Start a node of zv up that was stopped, has finished or failed.",
        "zv node start edge_front",
        completes=("node",),
    ),
    "node restart": Tool(
        "zv.tools.node.options:ControlOptions",
        "zv.tools.node.control:restart",
        "Stop a node that zv up runs, and start it again.",
        "zv node restart camera_front",
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
    "bag record": Tool(
        "zv.tools.bag.options:RecordOptions",
        "zv.tools.bag.record:run",
        "Record what is on the network into a file.",
        "zv bag record -o run.mcap\n"
        "zv bag record 'vision/front/**' -o front.mcap --for 60s\n"
        "zv bag record --last 30s --on-event line_crossed -o crash.mcap",
        "Without KEY: all of the cameras' data that is not made for display only. Descriptions, "
        "parameters and health of the nodes are always recorded, unless --exclude names them. With "
        "--split-mb, --split, --total-mb or --last there are several files, with the time in their "
        "names. --last writes nothing until it is triggered: by --on-event, --on-level, zv bag "
        "trigger, SIGUSR1, or Enter on a terminal.",
        completes=("key", "..."),
    ),
    "bag trigger": Tool(
        "zv.tools.bag.options:TriggerOptions",
        "zv.tools.bag.record:trigger",
        "Have recorders with --last write their last seconds.",
        "zv bag trigger --reason jam",
        "Exit status 1 if none answers.",
    ),
    "bag info": Tool(
        "zv.tools.bag.options:InfoOptions",
        "zv.tools.bag.info:run",
        "Show what is in a recording, and what is missing in it.",
        "zv bag info run.mcap\nzv bag info run.mcap --minutes --json",
        "complete: sequence numbers prove that nothing between the first and the last message was "
        "missed. Exit status 1 if the file is damaged or was not closed. Needs no router.",
    ),
    "bag repair": Tool(
        "zv.tools.bag.options:RepairOptions",
        "zv.tools.bag.edit:repair",
        "Complete a recording that was cut off, by a crash or a full disk.",
        "zv bag repair run.mcap.partial\nzv bag repair damaged.mcap -o readable.mcap",
        "Writes the index in place, which takes little space; with -o into a copy of all that is "
        "readable, which a damaged file needs. Needs no router.",
    ),
    "bag play": Tool(
        "zv.tools.bag.play_options:PlayOptions",
        "zv.tools.bag.play:run",
        "Play a recording: the same keys, bytes and pace.",
        "zv bag play run.mcap\n"
        "zv bag play run.mcap --as left --speed 0.5 --loop\n"
        "zv bag play run.mcap --lockstep tracker_front",
        "Original stamps are kept and marked as a replay, so that consumers judge the age of a "
        "frame by when it was sent. It is a node: zv param set player_front paused true, speed, "
        "step, position, loop. What another node publishes now is not played; beside a live camera "
        "of the same name it does not play. On a terminal, keys: " + PLAYER_KEYS,
        waits=True,
    ),
    "bag verify": Tool(
        "zv.tools.bag.verify_options:VerifyOptions",
        "zv.tools.bag.verify:run",
        "Run a service on recorded frames and compare its results with the recorded ones.",
        "zv bag verify run.mcap --node tracker --update golden.mcap\n"
        "zv bag verify golden.mcap --node tracker\n"
        "zv bag verify golden.mcap --node tracker --set learning_time=5s --tolerance tracks.x=0.5",
        "Every frame that the node answered when it was recorded is sent again, the next when it "
        "has answered all of the last, so nothing is dropped and nothing depends on the speed of "
        "the machine. The settings are the recorded ones, and follow their recorded changes. The "
        "first difference ends it with exit status 1: frame, field, both values, and a picture. "
        "Needs no router.",
    ),
    "bag cut": Tool(
        "zv.tools.bag.options:CutOptions",
        "zv.tools.bag.edit:cut",
        "Write the part of a recording between two times.",
        "zv bag cut run.mcap --start 10s --end 25s -o part.mcap",
        "The new file begins with the descriptions, parameters and latched messages of its start. "
        "Needs no router.",
    ),
    "bag merge": Tool(
        "zv.tools.bag.options:MergeOptions",
        "zv.tools.bag.edit:merge",
        "Write several recordings into one, in the order of arrival.",
        "zv bag merge front.mcap left.mcap -o both.mcap",
        "Needs no router.",
    ),
    "bag filter": Tool(
        "zv.tools.bag.options:FilterOptions",
        "zv.tools.bag.edit:filter_",
        "Write some keys of a recording into another.",
        "zv bag filter run.mcap 'vision/front/**' -o front.mcap\n"
        "zv bag filter run.mcap --exclude 'vision/*/edges/**' -o small.mcap",
        "@ keys are kept if they are named, or if no KEY is. Needs no router.",
    ),
    "bag convert": Tool(
        "zv.tools.bag.options:ConvertOptions",
        "zv.tools.bag.edit:convert",
        "Write a recording for ROS 2.",
        "zv bag convert run.mcap --profile ros2 -o ros.mcap",
        "Pictures become CompressedImage and Image, calibrations CameraInfo, centroids "
        "PointStamped, tracks Detection2DArray and Foxglove's ImageAnnotations. What ROS has no "
        "message for is left out. Needs no router.",
    ),
    "bag export": Tool(
        "zv.tools.bag.options:ExportOptions",
        "zv.tools.bag.export:run",
        "Write frames, a video, tracks or fields of a recording.",
        "zv bag export run.mcap -o frames/\n"
        "zv bag export run.mcap --draw -o run.mp4\n"
        "zv bag export run.mcap -o tracks.txt\n"
        "zv bag export run.mcap --key vision/front/centroid --field header.seq --field x -o x.csv",
        "Frames are written as they were recorded. Needs no router.",
    ),
    "bag import": Tool(
        "zv.tools.bag.options:ImportOptions",
        "zv.tools.bag.import_:run",
        "Make a recording of a video, a folder of images, or a recording of ROS.",
        "zv bag import walk.avi -o walk.mcap\nzv bag import drive.bag -o drive.mcap",
        "JPEG and PNG are taken as they are. Recordings of ROS 1 and ROS 2 need the extra bags: "
        "images, compressed images and camera_info become streams of a camera for each topic. "
        "Needs no router.",
    ),
    "security init": Tool(
        "zv.tools.security.options:InitOptions",
        "zv.tools.security.commands:init",
        "Make a certificate authority, and a certificate for every node, user and router.",
        "zv security init security --camera front --camera back --host vision.example.com",
        "Writes a folder with one file per node, which --credentials points at, and the router's "
        "configuration: certificates required, everything denied that a role does not need. Needs "
        "no router; nothing is overwritten.",
    ),
    "security add": Tool(
        "zv.tools.security.options:AddOptions",
        "zv.tools.security.commands:add",
        "Give certificates to further cameras, users, routers and nodes of your own.",
        "zv security add --camera left\n"
        "zv security add --node brightness_front --publishes vision/front/brightness "
        "--subscribes vision/front/image/compressed",
        "Somebody who was revoked gets a certificate under another number; --node alone gives it "
        "the rights that it had.",
    ),
    "security renew": Tool(
        "zv.tools.security.options:RenewOptions",
        "zv.tools.security.commands:renew",
        "Give holders new certificates before the former ones end.",
        "zv security renew camera_front\nzv security renew --all",
        "The former certificate stays valid until its end; revoke withdraws it.",
    ),
    "security revoke": Tool(
        "zv.tools.security.options:RevokeOptions",
        "zv.tools.security.commands:revoke",
        "Withdraw the rights of somebody's certificates, such as those of a stolen camera.",
        "zv security revoke camera_front",
        "The routers stop them when they have the new rules; others go on.",
    ),
    "security web": Tool(
        "zv.tools.security.options:WebOptions",
        "zv.tools.security.web:web",
        "Write a certificate for the viewer's own TLS, and those of people for their browsers.",
        "zv security web --host cam.example",
        "web.pem is the viewer's, for --tls-certificate of zv view; NAME.p12 is the certificate of "
        "an operator or guest, as browsers import it. Who has such a file needs no password.",
    ),
    "security show": Tool(
        "zv.tools.security.options:ShowOptions",
        "zv.tools.security.showing:show",
        "List the holders of certificates and until when these are valid, or one's rights.",
        "zv security show\nzv security show camera_front",
    ),
    "security check": Tool(
        "zv.tools.security.options:CheckOptions",
        "zv.tools.security.showing:check",
        "Say whether a node may do something on a key, and by which rule.",
        "zv security check camera_front vision/front/image/compressed publish",
        "Judges by the rules in the router's configuration. Exit status 1 if it is denied.",
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
