"""The runs of the ``quiet`` tests and of those that need to be alone leave none of them out."""

import pytest

from tests.conftest import LATER, MARKED, names_mark


def test_each_file_with_such_a_test_is_found_by_its_text(request: pytest.FixtureRequest):
    if request.config.args == request.config.getini("testpaths"):
        assert {mark for _, mark in MARKED} == set(LATER)
    assert [found for found in MARKED if not names_mark(*found)] == []
