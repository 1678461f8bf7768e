"""No page shows a command that no test runs."""

from __future__ import annotations

import pytest

from tests.support.pages import Page, begins, once_each
from tests.support.processes import ROOT

RUN_BY = {
    "README.md": "tests/docs/test_readme.py",
    "docs/cli.md": "tests/zv/cli/test_habits.py",  # an example of each help, parsed there
    "docs/deploy.md": "tests/docs/test_deploy.py",
    "docs/doctor.md": "tests/docs/test_doctor_doc.py",
    "docs/metrics.md": "tests/docs/test_readme.py",  # its one command stands there too
    "docs/parameters.md": "tests/docs/test_parameters_doc.py",
    "docs/tools.md": "tests/docs/test_tools_doc.py",
    "docs/viewer.md": "tests/docs/test_viewer_doc.py",
}


def test_every_page_with_commands_has_a_test_that_runs_them():
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")]
    places = {str(path.relative_to(ROOT)) for path in pages}
    assert {place for place in places if Page(place).commands()} == set(RUN_BY)
    assert all((ROOT / test).is_file() for test in RUN_BY.values())


def test_the_command_of_the_metrics_page_is_one_of_the_readme():
    assert set(Page("docs/metrics.md").commands()) <= set(Page("README.md").commands())


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch, tmp_path):
    text = "```sh\n# by hand\nzv top  # a table\n\nzv router -l 'x#y=1'\n```\n```text\nzv\n```\n"
    (tmp_path / "page.md").write_text(text)
    monkeypatch.setattr("tests.support.pages.ROOT", tmp_path)
    return Page("page.md")


def test_a_command_is_a_line_of_a_shell_block_without_its_comment(page: Page):
    assert page.commands() == ["zv top", "zv router -l 'x#y=1'"]
    assert page.commands("zv t", "zv n") == ["zv top"]
    assert page.blocks("text") == ["zv\n"]


def test_commands_are_told_by_their_words():
    assert begins("zv topic list", "zv", "topic")
    assert not begins("zv top", "zv", "topic")
    assert once_each("a", "b", "a") == ["a", "b"]
