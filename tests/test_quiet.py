"""The run of the ``quiet`` tests alone leaves none of them out."""

from tests.conftest import QUIET_FILES, names_quiet


def test_each_file_with_a_quiet_test_is_found_by_its_text():
    assert [str(file) for file in QUIET_FILES if not names_quiet(file)] == []
