"""Two sites with a router each, linked as docs/deploy.md says: camera on A, tracker on B."""

from __future__ import annotations

import re
from pathlib import Path

from tests.integration.conftest import some_services
from tests.support.fork_server import ZV
from tests.support.listening import Listener, living_nodes, open_client, wait_for_nodes
from tests.support.processes import Program
from tests.support.routing import free_port, port_answers, zenohd
from tests.support.viewer.pages import Page
from tests.support.waiting import wait_until
from zenoh_vision.node.frame_input import MAX_AGE_S

PAGE = Page("docs/deploy.md")
SITE_A = "tcp/192.0.2.10:7447"


def site_file() -> str:
    """Return the file of site B as the page has it."""
    (shown,) = [text for text in PAGE.blocks("json5") if SITE_A in text]
    return shown


def site_b(tmp_path: Path, site_a: str) -> tuple[Program, str]:
    """Start the router of site B with the page's command, and return it with its endpoint."""
    (tmp_path / "site-b.json5").write_text(site_file().replace(SITE_A, site_a))
    command = "zv router --listen tcp/0.0.0.0:7447 --zenoh-config site-b.json5"
    assert command in PAGE.commands()
    port = free_port()
    words = command.replace("0.0.0.0:7447", f"127.0.0.1:{port}").split()[1:]
    words[-1] = str(tmp_path / words[-1])
    program = Program(words, tmp_path, "router-b", forked=ZV)
    wait_until(lambda: port_answers(port), 20, lambda: program.complaints)
    return program, f"tcp/127.0.0.1:{port}"


def test_each_site_sees_both_and_goes_on_by_itself_while_the_link_is_gone(router, tmp_path):
    program, endpoint_b = site_b(tmp_path, router.endpoint)
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    with (
        program,
        some_services(router.endpoint, tmp_path / "a") as at_a,
        some_services(endpoint_b, tmp_path / "b") as at_b,
        open_client(router.endpoint) as client_a,
        open_client(endpoint_b) as client_b,
    ):
        services = [
            at_a("camera", "--rate", 20, "--width", 320, "--height", 240),
            at_b("tracker"),
            at_b("camera", "--camera", "yard", "--rate", 20, "--width", 320, "--height", 240),
        ]
        nodes = ("camera_front", "tracker_front", "camera_yard")
        for client in (client_a, client_b):
            wait_for_nodes(client, *nodes)
        centroids = [Listener(client, "vision/front/centroid") for client in (client_a, client_b)]
        frames = Listener(client_a, "vision/front/image/compressed")
        yard = Listener(client_b, "vision/yard/image/compressed")
        for listener in (*centroids, frames, yard):
            listener.wait_for(5)

        router.kill()
        wait_until(lambda: living_nodes(client_b) == {f"@vision/node/{n}" for n in nodes[1:]})
        cut_s = yard.messages[-1].at_s
        yard.wait_for(10, after_s=cut_s)
        answers_s = router.start()
        for listener in (*centroids, frames):
            back = listener.wait_for(1, 10, answers_s)[0]
            print(f"back after {back.at_s - answers_s:.2f} s")
        wait_for_nodes(client_a, *nodes)
        for listener in centroids:
            numbers = [message.header["seq"] for message in listener.messages]
            assert numbers == sorted(set(numbers))
        for message in centroids[0].since(answers_s):
            assert message.header["received_ns"] - message.header["stamp_ns"] < 1e9 * MAX_AGE_S
        assert all(service.process.poll() is None for service in services)


def test_zenohd_links_to_the_embedded_router_with_the_pages_command(router, tmp_path):
    command = re.search(r"^zenohd (.*)$", PAGE.text, re.MULTILINE)[1]
    port = free_port()
    words = [word.strip("'") for word in command.replace(SITE_A, router.endpoint).split()]
    with (
        zenohd(tmp_path, port, *words, "-l", f"tcp/127.0.0.1:{port}"),
        some_services(router.endpoint, tmp_path) as service,
        open_client(f"tcp/127.0.0.1:{port}") as client,
    ):
        service("camera")
        wait_for_nodes(client, "camera_front")
        Listener(client, "vision/front/image/compressed").wait_for(5)
