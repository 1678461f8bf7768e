"""Reads the video at the pace of the others, and nothing else: READER VIDEO N."""

import sys
from contextlib import closing

from benchmarks.peers.programs.measuring import Ages, opencv_frames, paced_frames
from zv.camera.sources.video import VideoSource


def libav_frames(path):
    """Yield the frames of a video once, as planes, which is how ``zv camera`` reads them."""
    with closing(VideoSource(path)) as source:
        while (picture := source.read()) is not None:
            yield picture


def main():
    """Read until there were enough."""
    reader, path, wanted = sys.argv[1:]
    ages = Ages(int(wanted))
    frames = {"opencv": opencv_frames, "libav": libav_frames}[reader]
    for _, stamp_ns in paced_frames(path, frames):
        if not ages.note(stamp_ns):
            break


if __name__ == "__main__":
    main()
