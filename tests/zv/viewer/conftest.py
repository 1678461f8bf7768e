"""Tests of the viewer may be coroutines."""

from tests.support.viewer.coroutines import pytest_pyfunc_call

__all__ = ["pytest_pyfunc_call"]
