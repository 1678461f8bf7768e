"""``zv security show`` and ``check``: who has which rights, and by which rule."""

from __future__ import annotations

import time

from zenoh_vision.errors import ConfigurationError, ExpectationNotMet
from zenoh_vision.security.credentials import DAY_S, WARN_S, shown_time
from zenoh_vision.security.rights import TO_ROUTER
from zenoh_vision.transport.connection import Connection
from zv.tools.security.folder import Folder
from zv.tools.security.options import CheckOptions, ShowOptions
from zv.tools.security.roles import ROUTER, rights_of
from zv.tools.security.verdict import verdict
from zv.tools.shared.output import Output


def show(options: ShowOptions, _connection: Connection, output: Output) -> None:
    """List the holders, or the rights of one.

    Raises:
        ConfigurationError: Nobody has this name.
        SourceError: There is no such folder.
    """
    folder = Folder(options.dir)
    system = folder.system()
    if options.name is not None:
        holder = system.holder(options.name)
        if holder.role.kind == ROUTER:
            raise ConfigurationError(f"{options.name} is a router: it passes everything on")
        rights = rights_of(options.name, holder.role, system.namespace)
        rows = [(action, key) for action, keys in rights.allowed.items() for key in keys]
        records = [{"action": action, "key": key} for action, key in rows]
        output.table(("action", "key expression"), rows, records)
        return
    columns = ("name", "role", "cameras", "ends", "state")
    holders, listed = [], []
    for name, holder in sorted(system.holders.items()):
        state = _state(holder.ends_s, holder.revoked_s)
        cameras = ", ".join(holder.role.cameras)
        holders.append((name, holder.role.kind, cameras, shown_time(holder.ends_s), state))
        listed.append(
            {
                "name": name,
                "role": holder.role.kind,
                "cameras": list(holder.role.cameras),
                "ends_s": holder.ends_s,
                "state": state,
            }
        )
    output.table(columns, holders, listed)


def check(options: CheckOptions, _connection: Connection, output: Output) -> None:
    """Say whether somebody may do something, by the rules in the router's configuration.

    Raises:
        ConfigurationError: Nobody has this name.
        SourceError: A file cannot be read.
        ExpectationNotMet: It is denied.
    """
    folder = Folder(options.dir)
    system = folder.system()
    holder = system.holder(options.node)
    router = next(iter(system.routers()))
    common_name = holder.common_name(options.node)
    with folder.router(router) as content:
        rules = content["access_control"]
        found = verdict(rules, common_name, TO_ROUTER[options.action], options.key)
    asked = {"node": options.node, "key": options.key, "action": options.action}
    if found.rules:
        said = "; ".join(f"rule {rule!r} allows {key}" for rule, key in found.rules)
        output.result({**asked, "allowed": True, "rules": found.rules}, f"allowed: {said}")
        return
    if output.as_json:
        output.record({**asked, "allowed": False, "rules": []})
    there = ", ".join(key for key in found.others if not key.startswith("@/")) or "nothing"
    raise ExpectationNotMet(
        f"denied: no rule allows {options.node} to {options.action} {options.key}; it may "
        f"{options.action} {there}"
    )


def _state(ends_s: float, revoked_s: float | None) -> str:
    if revoked_s is not None:
        return f"revoked {shown_time(revoked_s)}"
    left_s = ends_s - time.time()
    if left_s < 0:
        return "ended"
    return f"ends in {left_s / DAY_S:.0f} days" if left_s < WARN_S else "valid"
