"""Two routers on two Docker networks, linked by a third; the tracker is not where the camera is."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.containers.stack import Stack, pause, run
from tests.support.containers.witness import CENTROID, IMAGE, Witness, assert_whole
from tests.support.routing import free_port

pytestmark = [pytest.mark.compose, pytest.mark.timeout(1500)]
FILE = Path(__file__).with_name("two-sites.yml")


class TwoSites(Stack):
    """Two linked systems; ``endpoint`` is the router of the site with the tracker."""

    def __init__(self, checkout: Path) -> None:
        self.camera_port = free_port()
        super().__init__(
            checkout,
            settings={
                "ZV_TEST_PORT_A": str(self.camera_port),
                "ZV_TEST_CONFIG": str(checkout / "configs" / "router.json5"),
            },
        )
        self._env["ZV_TEST_PORT_B"] = str(self.port)
        self._files = [FILE]


@pytest.fixture(scope="module")
def sites(image: str, clone: Path) -> Iterator[TwoSites]:
    """Both sites, linked."""
    with TwoSites(clone) as running:
        yield running


def test_a_tracker_on_one_site_follows_the_camera_on_the_other(sites: TwoSites):
    with (
        Witness(sites.endpoint, (CENTROID,)) as there,
        Witness(f"tcp/127.0.0.1:{sites.camera_port}", (IMAGE, CENTROID)) as here,
    ):
        there.flows(60)
        here.flows(60)
        assert_whole(there[CENTROID].after(0))
        seen = {(one.epoch, one.seq) for one in here[IMAGE].after(0)}
        used = {(one.epoch, one.seq) for one in here[CENTROID].after(0)[5:-5]}
        print(f"{len(used & seen)} of {len(used)} results are of frames seen at the camera's site")
        assert len(used - seen) <= 5


def test_each_site_sees_the_nodes_of_both(sites: TwoSites):
    with Witness(sites.endpoint, (CENTROID,)) as there:
        there.flows(10)
        for node in ("camera_front", "tracker_front"):
            assert there.counters(node)


def test_the_link_between_the_sites_may_go_and_come(sites: TwoSites):
    with Witness(sites.endpoint, (CENTROID,)) as there:
        there.flows(30)
        container = sites.container("router-b")
        between = f"{sites.project}_between"
        run("docker", "network", "disconnect", between, container)
        pause(3.0)
        run("docker", "network", "connect", between, container)
        back_s = time.monotonic()
        took_s = there.back_s(back_s)
        there.flows(30, after_s=back_s)
        print(f"linked again {took_s:.2f} s after the network was back")
        assert_whole(there[CENTROID].captured_after(back_s))
        assert took_s < 15
