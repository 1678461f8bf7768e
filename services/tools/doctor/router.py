"""Checks of the router: its version, and shared memory."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import version as installed

from services.tools.doctor.finding import Finding
from services.tools.doctor.survey import Survey

BINDING = "eclipse-zenoh"
LOOK_IN = "let it be asked: adminspace: { enabled: true } in its configuration"
SWITCH_OFF = (
    "transport: { shared_memory: { enabled: false } } in the configuration of the router and of "
    "those programs: it leaks locked memory in the router (zenoh #2787)"
)


def version_findings(survey: Survey, endpoint: str) -> Iterator[Finding]:
    """Judge the routers that we are connected to."""
    if not survey.reached:
        yield Finding(
            "FAIL", "router", f"the router at {endpoint} went away", "see its log; start it again"
        )
    for zid in survey.reached:
        router = survey.routers.get(zid)
        if router is None or router.version is None:
            yield Finding("OK", "router", f"reached at {endpoint}, version unknown", LOOK_IN)
            continue
        ours = installed(BINDING)
        if _series(router.version) == _series(ours):
            yield Finding("OK", "router", f"zenoh {router.version} at {endpoint}")
        else:
            yield Finding(
                "WARN",
                "router",
                f"zenoh {router.version} at {endpoint}, here is {BINDING} {ours}",
                "run the same minor version on both sides",
            )


def memory_findings(survey: Survey) -> Iterator[Finding]:
    """Find sessions that share memory with a router, which is left on by default in Zenoh."""
    if not survey.routers:
        yield Finding("OK", "memory", "unknown whether memory is shared", LOOK_IN)
        return
    names = {each.session: each.name for each in survey.nodes}
    sharing = [names.get(zid, zid) for r in survey.routers.values() for zid in r.sharing]
    if sharing:
        who = ", ".join(sorted(sharing))
        yield Finding(
            "WARN", "memory", f"shared memory is on between the router and {who}", SWITCH_OFF
        )
    else:
        yield Finding("OK", "memory", "no session of the router uses shared memory")


def _series(version: str) -> list[str]:
    return version.split(".")[:2]
