"""Judges by a router's access rules, as the router itself does."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import zenoh


@dataclass(frozen=True, slots=True)
class Verdict:
    """What rules say about one action on one key expression.

    Attributes:
        rules: The id of each rule that allows a kind of its messages, and the key expression in
            it; empty if one of the kinds is denied.
        others: The key expressions on which the action is allowed.
    """

    rules: list[tuple[str, str]]
    others: list[str]


def verdict(
    access: Mapping[str, Any], common_name: str, messages: Iterable[str], key: str
) -> Verdict:
    """Judge messages to the router from the holder of a certificate.

    ``access`` is Zenoh's table ``access_control``. Each of the kinds of messages must be allowed.
    """
    subjects = {
        each["id"] for each in access["subjects"] if common_name in each["cert_common_names"]
    }
    granted = {
        rule
        for policy in access["policies"]
        if subjects.intersection(policy["subjects"])
        for rule in policy["rules"]
    }
    rules = [
        each for each in access["rules"] if each["id"] in granted and "ingress" in each["flows"]
    ]
    wanted = zenoh.KeyExpr(key)
    found: dict[tuple[str, str], None] = {}
    others: dict[str, None] = {}
    denied = False
    for kind in messages:
        allowed = False
        for each in rules:
            if kind not in each["messages"]:
                continue
            for expression in each["key_exprs"]:
                others[expression] = None
                if zenoh.KeyExpr(expression).includes(wanted):
                    found[each["id"], expression] = None
                    allowed = True
        denied |= not allowed
    return Verdict([] if denied else list(found), list(others))
