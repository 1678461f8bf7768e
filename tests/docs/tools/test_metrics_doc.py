"""docs/metrics.md and the dashboard are true: what they name is what is served."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.processes import ROOT, run_program
from tests.support.viewer.pages import Page
from zenoh_vision.health.fleet import GONE_S, MAX_NODES
from zenoh_vision.health.message_limits import MAX_COUNTERS
from zv.tools.metrics.families import FAMILIES, PREFIX
from zv.tools.metrics.options import MetricsOptions
from zv.tools.metrics.serving import MAX_REQUESTS

PAGE = Page("docs/metrics.md")
TEXT = PAGE.text
DASHBOARD = json.loads((ROOT / "docs" / "grafana" / "zenoh-vision.json").read_text())
PANELS: list[dict[str, Any]] = DASHBOARD["panels"]
HISTOGRAM_SERIES = ("_bucket", "_sum", "_count")
OF_PROMETHEUS = {"instance", "job", "le"}
"""Labels that are not ours: the scraper's and the histogram's."""


def served() -> dict[str, set[str]]:
    """Return the names of all series with their labels."""
    found: dict[str, set[str]] = {}
    for family in FAMILIES:
        if family.kind == "histogram":
            found |= {family.name + end: set(family.labels) for end in HISTOGRAM_SERIES}
        else:
            found[family.name] = set(family.labels)
    return found


def rules() -> str:
    """Return the file of alert rules."""
    (found,) = [block for block in PAGE.blocks("yaml") if block.startswith("groups:")]
    return found


def queries() -> Iterator[tuple[str, str]]:
    """Yield every query of the dashboard and the document, with where it stands."""
    for panel in PANELS:
        for target in panel["targets"]:
            yield f"{panel['title']} {target['refId']}", target["expr"]
    for variable in DASHBOARD["templating"]["list"]:
        if variable["type"] == "query":
            yield variable["name"], variable["query"]["query"]
    for block in PAGE.blocks("promql"):
        yield "document", block
    for number, text in enumerate(re.split(r"- alert:", rules())[1:]):
        expression = text.partition("expr:")[2].partition("for:")[0]
        yield f"alert {number}", expression.strip().removeprefix(">").strip()


QUERIES = [pytest.param(expression, id=place) for place, expression in queries()]


def test_every_metric_that_is_named_anywhere_is_served():
    named = set(re.findall(rf"{PREFIX}\w+", TEXT))
    assert named <= {*served(), *(family.name for family in FAMILIES)}


def test_the_figures_in_the_text_are_those_of_the_code():
    assert f"{MAX_NODES} nodes, {MAX_COUNTERS} counters a node, {MAX_REQUESTS} requests" in TEXT
    assert f"after {GONE_S:g} s without a report" in TEXT
    assert MetricsOptions().gone == 5 * 60
    assert "for 5 minutes (`--gone`)" in TEXT
    assert f"http://{MetricsOptions().listen}/metrics" in TEXT


@pytest.mark.parametrize("expression", QUERIES)
def test_a_query_uses_only_metrics_and_labels_that_are_served(expression: str):
    names = set(re.findall(rf"{PREFIX}\w+", expression))
    assert names
    assert names <= set(served())
    labels = set().union(*(served()[name] for name in names)) | OF_PROMETHEUS
    selected = re.findall(r"([a-z]+)\s*(?:=~|!~|!=|=)\s*\"", expression)
    grouped = re.findall(r"\b(?:by|on|group_left)\s*\(([^)]*)\)", expression)
    used = {*selected, *(name.strip() for group in grouped for name in group.split(","))} - {""}
    assert used <= labels


def test_every_counter_is_used_as_a_rate_and_every_histogram_with_le():
    counters = {name for name in served() if name.endswith(("_total", "_bucket"))}
    for _, expression in queries():
        for name in counters & set(re.findall(rf"{PREFIX}\w+", expression)):
            assert re.search(rf"(rate|increase)\({name}", expression), expression
            assert not name.endswith("_bucket") or re.search(r"by \([^)]*\ble\b", expression)


def test_promtool_accepts_every_query_and_rule(tmp_path: Path):
    promtool = shutil.which("promtool")
    if promtool is None:
        pytest.skip("promtool is not installed (Debian: prometheus)")
    lines = ["groups:", "  - name: queries", "    rules:"]
    for number, (_, expression) in enumerate(queries()):
        if not expression.startswith("label_values"):
            plain = expression.replace("$__rate_interval", "1m").replace("$node", ".*")
            lines += [f"      - record: q{number}", f"        expr: {json.dumps(plain)}"]
    for name, text in (("alerts.yml", rules()), ("queries.yml", "\n".join(lines))):
        (tmp_path / name).write_text(text)
        done = run_program([promtool, "check", "rules", tmp_path / name])
        assert done.returncode == 0, done.stdout + done.stderr


# The dashboard


def test_grafana_can_import_the_dashboard():
    assert DASHBOARD["id"] is None  # Grafana gives it one on import
    assert DASHBOARD["schemaVersion"] >= 36  # the first with a data source as type and uid
    assert len({panel["id"] for panel in PANELS}) == len(PANELS)
    for panel in PANELS:
        letters = [target["refId"] for target in panel["targets"]]
        assert len(set(letters)) == len(letters) > 0
        for holder in (panel, *panel["targets"]):
            assert holder["datasource"] == {"type": "prometheus", "uid": "${datasource}"}


def test_every_variable_that_is_used_is_defined():
    used = set(re.findall(r"\$\{?([a-z]\w*)\}?", json.dumps(DASHBOARD)))
    assert used == {variable["name"] for variable in DASHBOARD["templating"]["list"]}
