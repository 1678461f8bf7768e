"""What zv snapshot takes for a file to write."""

from __future__ import annotations

import pytest

from zenoh_vision.config.settings import load_settings
from zenoh_vision.errors import ConfigurationError
from zv.tools.snapshot.options import SnapshotOptions


def test_a_file_whose_ending_names_no_format_is_refused_with_those_that_do():
    flags = {"key": "a/b", "output": "frame.txt"}
    with pytest.raises(ConfigurationError, match=r"allowed: a name that ends in \.jpg, .*; or -"):
        load_settings(SnapshotOptions, flags=flags)
    for name in ("a.JPG", "a.jpeg", "b/a.png", "-"):
        assert load_settings(SnapshotOptions, flags=flags | {"output": name}).output == name
