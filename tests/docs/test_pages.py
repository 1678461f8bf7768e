"""No page shows a command that no test runs."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

from tests.support.processes import ROOT
from tests.support.viewer.pages import Page

RUN_BY = {
    "README.md": "tests/docs/test_readme.py",
    "docs/calibration.md": "tests/docs/test_calibration_doc.py",
    "docs/cameras.md": "tests/docs/test_readme.py",
    "docs/cli.md": "tests/zv/cli/test_habits.py",  # an example of each help, parsed there
    "docs/containers.md": "tests/compose/test_containers_doc.py",
    "docs/deploy.md": "tests/docs/test_deploy.py",
    "docs/detector.md": "tests/docs/test_detector_doc.py",
    "docs/edges.md": "tests/docs/test_edges_doc.py",
    "docs/doctor.md": "tests/docs/tools/test_doctor_doc.py",
    "docs/events.md": "tests/docs/test_events_doc.py",
    "docs/index.md": "tests/docs/test_events_doc.py",
    "docs/metrics.md": "tests/docs/test_readme.py",
    "docs/notify.md": "tests/docs/test_notify_doc.py",
    "docs/parameters.md": "tests/docs/tools/test_parameters_doc.py",
    "docs/recording.md": "tests/docs/test_recording_doc.py",
    "docs/relay.md": "tests/docs/test_relay_doc.py",
    "docs/replay.md": "tests/docs/test_replay_doc.py",
    "docs/running.md": "tests/docs/test_readme.py",
    "docs/testing.md": "tests/docs/test_readme.py",
    "docs/security.md": "tests/docs/test_security_doc.py",
    "docs/services.md": "tests/docs/test_services_doc.py",
    "docs/tools.md": "tests/docs/tools/test_tools_doc.py",
    "docs/tuning.md": "tests/docs/test_tuning_doc.py",
    "docs/viewer.md": "tests/docs/test_viewer_doc.py",
}


def test_every_page_with_commands_has_a_test_that_runs_them():
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")]
    places = {str(path.relative_to(ROOT)) for path in pages}
    assert {place for place in places if Page(place).commands()} == set(RUN_BY)
    assert all((ROOT / test).is_file() for test in RUN_BY.values())


BLOCKING = re.compile(
    r"make up|zv (router|camera|notify|tracker|recorder|relay|edge(?! --image)|view|up|metrics)\b"
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


@pytest.mark.parametrize(
    "script", sorted(ROOT.glob("docs/images/make_*.py")), ids=lambda at: at.stem
)
def test_what_renders_a_picture_still_finds_what_it_draws_with(script: Path):
    assert importlib.import_module(f"docs.images.{script.stem}").main
