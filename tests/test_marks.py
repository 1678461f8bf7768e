"""The runs of the ``quiet`` tests and of those that need to be alone leave none of them out."""

from tests.conftest import MARKED, names_mark


def test_each_file_with_such_a_test_is_found_by_its_text():
    assert [found for found in MARKED if not names_mark(*found)] == []
