"""No page shows a command that no test runs."""

from __future__ import annotations

import re

import pytest

from tests.support.processes import ROOT
from tests.support.viewer.pages import Page, begins, once_each

RUN_BY = {
    "README.md": "tests/docs/test_readme.py",
    "docs/calibration.md": "tests/docs/test_calibration_doc.py",
    "docs/cameras.md": "tests/docs/test_readme.py",
    "docs/cli.md": "tests/zv/cli/test_habits.py",  # an example of each help, parsed there
    "docs/containers.md": "tests/compose/test_containers_doc.py",
    "docs/deploy.md": "tests/docs/test_deploy.py",
    "docs/edges.md": "tests/docs/test_edges_doc.py",
    "docs/doctor.md": "tests/docs/tools/test_doctor_doc.py",
    "docs/events.md": "tests/docs/test_events_doc.py",
    "docs/metrics.md": "tests/docs/test_readme.py",
    "docs/parameters.md": "tests/docs/tools/test_parameters_doc.py",
    "docs/running.md": "tests/docs/test_readme.py",
    "docs/testing.md": "tests/docs/test_readme.py",
    "docs/services.md": "tests/docs/test_services_doc.py",
    "docs/tools.md": "tests/docs/tools/test_tools_doc.py",
    "docs/viewer.md": "tests/docs/test_viewer_doc.py",
}


def test_every_page_with_commands_has_a_test_that_runs_them():
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")]
    places = {str(path.relative_to(ROOT)) for path in pages}
    assert {place for place in places if Page(place).commands()} == set(RUN_BY)
    assert all((ROOT / test).is_file() for test in RUN_BY.values())


BLOCKING = re.compile(
    r"make up|zv (router|camera|tracker|edge(?! --image)|view|up|metrics)\b"
    r"|python brightness.py --config"
    r"|python examples/(subscribe|own_service|publish_from_anything|show)\b"
    r"|.*docker compose( -f \S+)* up$"
)


@pytest.mark.parametrize("place", sorted({*RUN_BY} - {"docs/cli.md"}))  # which lists examples
def test_a_command_that_goes_on_until_it_is_ended_has_a_block_of_its_own(place: str):
    page = Page(place)
    for block in page.blocks("sh"):
        lines = page.commands_in(block)
        assert len(lines) == 1 or not any(BLOCKING.match(line) for line in lines), block


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch, tmp_path):
    text = "```sh\n# by hand\nzv top  # a table\n\nzv router -l 'x#y=1'\n```\n```text\nzv\n```\n"
    (tmp_path / "page.md").write_text(text)
    monkeypatch.setattr("tests.support.viewer.pages.ROOT", tmp_path)
    return Page("page.md")


def test_a_command_is_a_line_of_a_shell_block_without_its_comment(page: Page):
    assert page.commands() == ["zv top", "zv router -l 'x#y=1'"]
    assert page.commands("zv t", "zv n") == ["zv top"]
    assert page.blocks("text") == ["zv\n"]


def test_commands_are_told_by_their_words():
    assert begins("zv topic list", "zv", "topic")
    assert not begins("zv top", "zv", "topic")
    assert once_each("a", "b", "a") == ["a", "b"]
