"""The registry of services: its topics exist, are documented, and are connected."""

from __future__ import annotations

import re
import sys

import pytest

from tests.support.processes import ROOT, run_program
from zenoh_vision.topics import TOPICS
from zv.registry import EVERY_TOPIC, SERVICES


@pytest.mark.parametrize("service", SERVICES)
def test_every_topic_of_a_service_is_in_the_librarys_table(service: str):
    assert set(SERVICES[service].publishes) <= set(TOPICS)
    assert set(SERVICES[service].consumes) <= set(TOPICS) | {EVERY_TOPIC}


def test_what_one_service_consumes_another_publishes():
    published = {suffix for service in SERVICES for suffix in SERVICES[service].publishes}
    consumed = {suffix for service in SERVICES for suffix in SERVICES[service].consumes}
    assert consumed - {EVERY_TOPIC} <= published


@pytest.mark.parametrize("service", [name for name in SERVICES if SERVICES[name].publishes])
def test_the_table_of_keys_names_the_sender_of_each_topic(service: str):
    page = (ROOT / "docs" / "messages.md").read_text()
    rows = re.findall(r"^\| `\{ns\}/\{camera\}/(\S+)` \|.*\| ([^|]+) \|$", page, re.MULTILINE)
    documented = {suffix for suffix, sender in rows if service in sender}
    assert documented == set(SERVICES[service].publishes)


def test_the_registry_loads_no_library():
    program = (
        "import sys, zv.registry\n"
        "print({'pydantic', 'zenoh', 'cv2', 'numpy', 'zenoh_vision'} & set(sys.modules))"
    )
    done = run_program([sys.executable, "-c", program])
    assert (done.stdout, done.stderr) == ("set()\n", "")
