"""``zv bag import``: makes a recording of a video, a folder of images, or a recording of ROS."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from zenoh_vision.errors import SourceError
from zenoh_vision.transport.connection import Connection
from zv.bag.imports.pictures import folder_records, video_records
from zv.bag.imports.ros import ros_records
from zv.bag.imports.stream import CameraStream
from zv.bag.record import Record
from zv.tools.bag.edit import write_checked
from zv.tools.bag.options import ImportOptions
from zv.tools.bag.progress import progress_on
from zv.tools.shared.output import Output

OF_ROS = (".bag", ".mcap", ".db3")


def run(options: ImportOptions, connection: Connection, output: Output) -> None:
    """Write the recording.

    Raises:
        SourceError: The source cannot be read, or has no pictures.
        RecordingError: The file cannot be made.
    """
    source, noted = Path(options.source), set[str]()
    if not source.exists():
        raise SourceError(f"{source}: no such file or folder")

    def note(text: str) -> None:
        if text not in noted and len(noted) < 20:
            noted.add(text)
            output.note(text)

    with progress_on(output) as progress:
        records = _records(source, options, connection.namespace, progress, note)
        about = {"namespace": connection.namespace, "made_by": "zv bag import"}
        about["made_of"] = source.name
        count = write_checked(records, Path(options.output), about)
    fields = {"file": options.output, "messages": count}
    output.result(fields, f"{options.output}: {count} messages")


def _records(
    source: Path,
    options: ImportOptions,
    namespace: str,
    progress: Callable[[int, int], None],
    note: Callable[[str], None],
) -> Iterator[Record]:
    def stream(camera: str) -> CameraStream:
        return CameraStream(namespace, camera, options.quality, lossless=options.lossless)

    if source.suffix.lower() in OF_ROS or (source / "metadata.yaml").exists():
        path = source.parent if source.suffix == ".db3" else source
        return ros_records(path, stream, namespace, options.camera, progress, note)
    if source.is_dir():
        return folder_records(source, stream(options.camera), options.rate, progress)
    return video_records(source, stream(options.camera), progress, note)
