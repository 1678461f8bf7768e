"""Disks that are full or cannot be written, and a log that is flooded."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.containers.stack import OURS, Stack, run
from tests.support.containers.witness import Witness, assert_whole
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.compose, pytest.mark.timeout(1500)]
KEPT_MB = 3.5  # three files of 1 MB, and what is written before Docker turns over


def test_a_full_disk_stops_nothing_and_health_stays_true(stack: Stack, witness: Witness):
    starts = {service: stack.starts(service) for service in OURS}
    fill = "cat /dev/zero >/tmp/full 2>/dev/null; echo x >>/tmp/more && exit 1; exit 0"
    try:
        for service in OURS:
            run("docker", "exec", stack.container(service), "sh", "-c", fill)
        since_s = witness.streams["vision/front/centroid"].seen[-1].at_s
        # 5 s the file may be old, and then two checks fail: a truth that is no more would show.
        witness.flows(450, after_s=since_s)
        assert {stack.health(service) for service in OURS} == {"healthy"}
        for stream in witness.streams.values():
            assert_whole(stream.after(since_s))
    finally:
        for service in OURS:
            run("docker", "exec", stack.container(service), "rm", "-f", "/tmp/full", "/tmp/more")
    assert {service: stack.starts(service) for service in OURS} == starts


def test_without_any_place_to_write_a_system_works_and_says_what_is_missing(
    new_stack, tmp_path: Path
):
    override = tmp_path / "read-only.yml"
    lines = ["services:"]
    for service in OURS:
        lines += [f"  {service}:", '    environment: {ZV_HEALTH_FILE: "/nowhere/health"}']
    override.write_text("\n".join(lines) + "\n")
    stack = new_stack(override)
    with Witness(stack.endpoint) as witness:
        witness.flows(60)
        for service in OURS:
            said = stack.logs(service).count("ZV_HEALTH_FILE /nowhere/health: No such file")
            assert said == 1, stack.logs(service)
            # Nothing can be told from a file that is not there.
            wait_until(lambda name=service: stack.health(name) == "unhealthy", 60)
        witness.flows(90)


def test_a_flood_of_log_lines_is_kept_within_bounds(stack: Stack, witness: Witness):
    container = stack.container("tracker")
    flood = "yes 'a line of a flood, as long as lines of a log are' | head -c 12000000"
    since_s = witness.streams["vision/front/centroid"].seen[-1].at_s
    run("docker", "exec", container, "sh", "-c", f"{flood} >/proc/1/fd/2")
    folder = Path(stack.inspect("tracker")["LogPath"]).parent
    files = list(folder.glob("*-json.log*"))
    kept_mb = sum(file.stat().st_size for file in files) / 1e6
    print(f"{kept_mb:.1f} MB kept of 12 MB, in {len(files)} files")
    assert 0 < kept_mb < KEPT_MB
    witness.flows(60, after_s=since_s)
    assert stack.health("tracker") == "healthy"
