"""A file that is written is complete, or as it was before."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from zenoh_vision.errors import SourceError
from zenoh_vision.host.files import write_file

TOO_MUCH = bytes(2000)


@pytest.mark.usefixtures("full_disk")
def test_a_full_disk_leaves_no_part_of_a_new_file(tmp_path: Path):
    with pytest.raises(SourceError, match=r"new\.jpg: File too large$"):
        write_file(tmp_path / "new.jpg", TOO_MUCH)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("full_disk")
def test_a_full_disk_leaves_a_file_as_it_was(tmp_path: Path):
    path = tmp_path / "old.jpg"
    path.write_bytes(b"old")
    with pytest.raises(SourceError):
        write_file(path, TOO_MUCH)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == b"old"


def test_a_file_keeps_its_rights_and_its_links(tmp_path: Path):
    path, link = tmp_path / "file", tmp_path / "link"
    path.write_bytes(b"old")
    path.chmod(0o640)
    link.symlink_to(path)
    write_file(link, b"new")
    assert link.is_symlink()
    assert (path.read_bytes(), path.stat().st_mode & 0o777) == (b"new", 0o640)


def test_a_pipe_is_written_directly(tmp_path: Path):
    pipe, read = tmp_path / "pipe", list[bytes]()
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    write_file(pipe, b"new")
    reader.join()
    assert read == [b"new"]
    assert pipe.is_fifo()


@pytest.mark.parametrize("name", ["nowhere/file", "", "a\0b"])
def test_a_file_that_cannot_be_written_is_named(tmp_path: Path, name: str):
    with pytest.raises(SourceError, match=str(tmp_path)):
        write_file(f"{tmp_path}/{name}", b"new")
    assert not list(tmp_path.iterdir())
