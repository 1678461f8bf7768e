"""A real RTSP camera for tests, run as a script by the interpreter that has GStreamer.

Debian: ``gir1.2-gst-rtsp-server-1.0 python3-gi gstreamer1.0-plugins-{base,good,ugly}``. Streams
on a free port of the loopback interface, or of the address and on the port given as arguments, a
moving test picture of 320x240 at 30 Hz:

- ``/h264`` and ``/mjpeg``; ``/udp``, H.264 that is refused over TCP;
- ``/h264/lossy``, ``/h265/lossy`` and ``/mjpeg/lossy``, of whose packets some never leave, by TCP
  or UDP; each connection gets the pictures from the first, like ``/h264/whole`` and so on;
- ``/locked``, H.264 for user ``viewer`` with password ``secret`` only.

Prints the port as its first line, then serves until it is ended. ``SIGSTOP`` makes it stall.
"""

# mypy: ignore-errors

from __future__ import annotations

import sys

CAPS = "video/x-raw,format=I420,width=320,height=240,framerate=30/1"
PATTERN = f"videotestsrc is-live=true pattern=ball ! {CAPS}"
PICTURE = f"{PATTERN} ! timeoverlay"
H264 = "x264enc tune=zerolatency key-int-max=15 ! rtph264pay config-interval=1 name=pay0"
H265 = "x265enc tune=zerolatency key-int-max=15 ! rtph265pay config-interval=1 name=pay0"
MJPEG = "jpegenc quality=80 ! rtpjpegpay name=pay0"
ENCODINGS = {"/h264": H264, "/h265": H265, "/mjpeg": MJPEG}
STREAMS = {
    **{path: f"( {PICTURE} ! {encoding} )" for path, encoding in ENCODINGS.items()},
    "/locked": f"( {PICTURE} ! {H264} )",
    "/udp": f"( {PICTURE} ! {H264} )",
}
SMALL = "mtu=500 ! identity"  # several packets for a picture
ALONE = {
    f"{path}/{name}": f"( {PATTERN} ! {encoding.replace('name=pay0', SMALL)} name=pay0 {lost} )"
    for path, encoding in ENCODINGS.items()
    for name, lost in (("whole", ""), ("lossy", "drop-probability=0.01"))
}
USER, PASSWORD = "viewer", "secret"


def main() -> int:
    """Serve until ended; 69 (unavailable) when GStreamer's bindings are not installed."""
    try:
        import gi

        gi.require_version("Gst", "1.0")
        gi.require_version("GstRtsp", "1.0")
        gi.require_version("GstRtspServer", "1.0")
        from gi.repository import GLib, Gst, GstRtsp, GstRtspServer
    except (ImportError, ValueError) as error:
        print(error, file=sys.stderr)
        return 69
    Gst.init(None)
    needed = ["videotestsrc", "timeoverlay", "jpegenc", "rtpjpegpay"]
    needed += ["x264enc", "rtph264pay", "x265enc", "rtph265pay"]
    missing = [name for name in needed if Gst.ElementFactory.find(name) is None]
    if missing:
        print(f"GStreamer elements are missing: {', '.join(missing)}", file=sys.stderr)
        return 69

    server = GstRtspServer.RTSPServer()
    server.set_address(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1")
    server.set_service(sys.argv[2] if len(sys.argv) > 2 else "0")
    authentication = GstRtspServer.RTSPAuth()
    token = GstRtspServer.RTSPToken()
    token.set_string("media.factory.role", "user")
    basic = GstRtspServer.RTSPAuth.make_basic(USER, PASSWORD)
    authentication.add_basic(basic, token)
    anonymous = GstRtspServer.RTSPToken()
    anonymous.set_string("media.factory.role", "anonymous")
    authentication.set_default_token(anonymous)
    server.set_auth(authentication)

    for path, pipeline in {**STREAMS, **ALONE}.items():
        factory = GstRtspServer.RTSPMediaFactory()
        factory.set_launch(pipeline)
        factory.set_shared(path not in ALONE)
        if path == "/udp":
            factory.set_protocols(GstRtsp.RTSPLowerTrans.UDP)
        roles = GstRtspServer.RTSPPermissions()
        for role in ("user", "anonymous"):
            # Seen but not opened is what is answered with 401; not even seen would be 404.
            may_open = role == "user" or path != "/locked"
            roles.add_permission_for_role(role, "media.factory.access", True)
            roles.add_permission_for_role(role, "media.factory.construct", may_open)
        factory.set_permissions(roles)
        server.get_mount_points().add_factory(path, factory)
    if server.attach(None) == 0:
        print("the server cannot be started", file=sys.stderr)
        return 1
    print(server.get_bound_port(), flush=True)
    GLib.MainLoop().run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
