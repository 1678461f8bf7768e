"""What each role may do on each key: ``table``, written by hand from the contract of keys.

It knows nothing of how ``zv security`` derives rights.
"""

from __future__ import annotations

from collections.abc import Iterable

CAMERA = {"image/compressed", "image", "camera_info", "truth"}
TRACKER = {
    "centroid", "tracks", "events", "prediction", "tracked/compressed", "mask/compressed",
    "background/compressed",
}  # fmt: skip
EDGE = {
    "edges/compressed", "edges/smoothed/compressed", "edges/magnitude/compressed",
    "edges/direction/compressed", "edges/suppressed/compressed", "edges/thresholded/compressed",
    "edges/contours",
}  # fmt: skip
RELAYED = {"relayed/compressed"}
PICTURES = {"image/compressed", "image"}
INPUT = PICTURES | {"camera_info"}
SHOWN_PICTURES = {
    *PICTURES, "tracked/compressed", "mask/compressed", "background/compressed",
    *(EDGE - {"edges/contours"}),
}  # fmt: skip
TOLD = {"events", "tracked/compressed", "image/compressed"}
SUFFIXES = CAMERA | TRACKER | EDGE | RELAYED | {"replay", "brightness", "anything"}


def of(suffixes: Iterable[str], *cameras: str) -> set[str]:
    return {f"vision/{camera}/{suffix}" for camera in cameras for suffix in suffixes}


LIVE = ("front", "back")
PLAYED = of({"image/compressed", "centroid", "replay", "anything"}, "walk")
PUBLISHES = {
    "camera_front": of(CAMERA, "front"),
    "tracker_front": of(TRACKER, "front"),
    "tracker": of(TRACKER, *LIVE),
    "edge_front": of(EDGE, "front"),
    "relay_front": of(RELAYED, "front"),
    "brightness_front": {"vision/front/brightness"},
    "player": PLAYED,
}
CONSUMES = {
    "tracker_front": of(INPUT, "front"),
    "tracker": of(INPUT, *LIVE),
    "edge_front": of(PICTURES, "front"),
    "relay_front": of(SHOWN_PICTURES | {"camera_info"}, "front"),
    "notify": of(TOLD, *LIVE) | (of(TOLD, "walk") & PLAYED),
    "brightness_front": {"vision/front/image/compressed"},
}
NODES = (
    "camera_front", "tracker_front", "tracker", "edge_front", "relay_front", "brightness_front",
    "notify", "viewer", "recorder", "player",
)  # fmt: skip
OTHERS = {"player": "player_walk"}
"""Who has a second node: that of a recording of one camera."""
SEES_ALL = ("viewer", "recorder", "player", "operator", "guest", "launcher")
SETS = ("viewer", "operator")
ROLES = (*NODES, "operator", "guest", "launcher")

DATA = [*sorted(of(SUFFIXES, *LIVE)), *sorted(PLAYED)]
SHOWN = (*NODES, *OTHERS.values(), "camera_back", "nobody")
SHARED = {camera: f"@vision/shm/{camera}/m/o" for camera in LIVE}
CONTROL = [
    *(f"@vision/node/{node}" for node in SHOWN),
    *(f"@vision/diagnostics/{node}" for node in SHOWN),
    *(f"@vision/param/{node}" for node in SHOWN),
    *(f"@vision/param/{node}/quality" for node in SHOWN),
    *(f"@vision/set/{node}" for node in SHOWN),
    *(f"@vision/set/{node}/quality" for node in SHOWN),
    *(f"@vision/launch/{node}" for node in SHOWN),
    *(f"@vision/record/{node}" for node in ("recorder", "another")),
    *SHARED.values(),
    "@vision/schema/Centroid",
]
HOLDERS = {name: f"zenoh-vision/holder/{name}" for name in (*ROLES, "nobody")}
"""Keys on which a certificate's holder shows that the router accepts it."""

FOREIGN = ["other/front/image", "@other/node/camera_front", "@other/set/camera_front"]
KEYS = [*DATA, *CONTROL, *HOLDERS.values(), *FOREIGN]


def may(role: str, action: str, key: str) -> bool:
    """Say by the table whether somebody may do something."""
    kind, _, node = key.removeprefix("@vision/").partition("/")
    node = node.partition("/")[0]
    if kind in ("shm", "launch", "record") or key in HOLDERS.values():
        return may_apart(role, action, key, kind)
    publishes, consumes = PUBLISHES.get(role, set()), CONSUMES.get(role, set())
    is_node, sees = role in NODES, role in SEES_ALL
    mine = key.startswith("@vision/") and is_node and node in (role, OTHERS.get(role))
    match action:
        case "publish":
            return (
                key in publishes
                or (mine and key.count("/") == 3) * (kind == "param")
                or (mine and kind == "diagnostics")
            )
        case "answer":
            own = mine and kind in ("node", "diagnostics", "param", "set")
            return key in publishes or own or (is_node and kind == "schema")
        case "subscribe":
            everything = key.startswith("vision/") or kind == "diagnostics"
            changes = kind == "param" and key.count("/") == 3
            return (
                key in consumes
                or (mine and kind == "diagnostics")
                or (sees and (everything or changes))
            )
        case "query":
            seen = kind in ("node", "diagnostics", "param", "schema")
            everything = key.startswith("vision/") or (key.startswith("@vision/") and seen)
            sets = role in SETS and kind == "set"
            return key in consumes or (mine and kind == "node") or (sees and everything) or sets
        case "announce":
            return mine and kind == "node"
        case "watch":
            return sees and key.startswith("@vision/node/")
    raise AssertionError(action)


def may_apart(role: str, action: str, key: str, kind: str) -> bool:
    """Say it of the keys of shared memory, of the launcher, of recorders and of holders."""
    sees = role in SEES_ALL
    if kind == "shm":
        (camera,) = (camera for camera, shared in SHARED.items() if shared == key)
        taker = bool(CONSUMES.get(role, set()) & of(PICTURES, camera))
        return {
            "announce": role == "camera_front" and camera == "front",
            "watch": taker or sees,
            "subscribe": taker or role in ("viewer", "recorder"),
        }.get(action, False)
    if kind == "launch":
        return (action, role) in {("answer", "launcher"), ("query", "operator")}
    if kind == "record":
        own = key == "@vision/record/recorder" and role == "recorder"
        return (action == "answer" and (own or role == "operator")) or (
            action == "query" and role == "operator"
        )
    return (action == "answer" and key == HOLDERS[role]) or (action == "query" and sees)


def table(role: str, action: str) -> set[str]:
    """Return the keys on which a role may do something."""
    return {key for key in KEYS if may(role, action, key)}
