"""Errors end the command line with the contract's exit status."""

from __future__ import annotations

import pytest

from zenoh_vision import errors


@pytest.mark.parametrize(
    ("name", "status"),
    [
        ("VisionError", 1),
        ("ConfigurationError", 2),
        ("SourceError", 3),
        ("SourceLost", 3),
        ("RouterUnreachable", 4),
        ("ToldToStop", 0),
    ],
)
def test_exit_status(name: str, status: int):
    error = getattr(errors, name)("why")
    assert isinstance(error, errors.VisionError)
    assert error.exit_status == status


def test_a_payload_error_says_under_which_name_it_is_counted():
    error = errors.PayloadError("corrupt", "the PNG is truncated")
    assert (error.reason, error.detail) == ("corrupt", "the PNG is truncated")
    assert str(error) == "corrupt: the PNG is truncated"
