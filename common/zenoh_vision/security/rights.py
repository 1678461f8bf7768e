"""Rights: what a holder of a certificate may do on which keys, and the access rules for that."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final, Literal, Self, get_args

Action = Literal["publish", "answer", "subscribe", "query", "announce", "watch"]
"""``answer``: reply to queries, after declaring a queryable. ``announce``: show a liveliness token.
``watch``: ask for liveliness tokens, or follow them."""

ACTIONS: Final[tuple[Action, ...]] = get_args(Action)

TO_ROUTER: Final[Mapping[Action, tuple[str, ...]]] = {
    "publish": ("put",),
    "answer": ("declare_queryable", "reply"),
    "subscribe": ("declare_subscriber",),
    "query": ("query",),
    "announce": ("liveliness_token",),
    "watch": ("liveliness_query", "declare_liveliness_subscriber"),
}
"""Kinds of Zenoh's messages that each action sends to the router. Nobody may delete."""

FROM_ROUTER: Final[Mapping[Action, tuple[str, ...]]] = {
    "subscribe": ("put",),
    "query": ("reply",),
    "watch": ("liveliness_token",),
}
"""Kinds of messages that each action needs from the router, on the same keys."""

DEMAND: Final[Mapping[Action, str]] = {"publish": "declare_subscriber", "answer": "query"}
"""What a publisher hears of others: that someone subscribes, and what is asked. Such a key
expression may have wildcards that include far more than the publisher's own keys, and Zenoh
compares it as a whole, so these come for the whole namespace, and for all holders."""

EVERYTHING: Final = (
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
)
"""All kinds of messages, for the links between routers, each of which applies its own rules."""


@dataclass(frozen=True, slots=True)
class Rights:
    """Key expressions by action; what is in none of them is denied.

    Attributes:
        allowed: Each expression once, in the order in which they were added.
    """

    allowed: Mapping[Action, tuple[str, ...]]

    @classmethod
    def of(cls, pairs: Iterable[tuple[Action, Iterable[str]]]) -> Self:
        """Collect pairs of an action and key expressions."""
        found: dict[Action, dict[str, None]] = {}
        for action, keys in pairs:
            found.setdefault(action, {}).update(dict.fromkeys(keys))
        return cls({action: tuple(found[action]) for action in ACTIONS if found.get(action)})

    @classmethod
    def from_map(cls, fields: object) -> Self:
        """Read the rights in a file; what is no right is left out."""
        pairs = fields.items() if isinstance(fields, Mapping) else ()
        return cls.of(
            (action, [key for key in keys if isinstance(key, str)])
            for action, keys in pairs
            if action in ACTIONS and isinstance(keys, list)
        )

    def to_map(self) -> dict[str, list[str]]:
        """Return the rights in the form of a file."""
        return {action: list(keys) for action, keys in self.allowed.items()}

    def granting(self, action: Action, key: str) -> str | None:
        """Return the expression that allows an action on a key expression; None if none does.

        As in Zenoh, the expression must include the whole of the key expression.
        """
        import zenoh  # the help of commands needs the names of the actions, without loading it

        wanted = zenoh.KeyExpr(key)
        for each in self.allowed.get(action, ()):
            with suppress(zenoh.ZError):  # in a file that was edited, it may be no key expression
                if zenoh.KeyExpr(each).includes(wanted):
                    return each
        return None

    def rules(self, name: str, within: Iterable[str]) -> list[dict[str, Any]]:
        """Return Zenoh's access rules that allow exactly this.

        Args:
            name: Begins the id of each rule.
            within: Key expressions of the whole namespace, and of all holders.
        """
        found = []
        for action, keys in self.allowed.items():
            found.append(rule(f"{name}: {action}", "ingress", TO_ROUTER[action], keys))
            if action in FROM_ROUTER:
                back = FROM_ROUTER[action]
                found.append(rule(f"{name}: {action}, received", "egress", back, keys))
        hears = [DEMAND[action] for action in self.allowed if action in DEMAND]
        if hears:
            found.append(rule(f"{name}: demand", "egress", hears, within))
        return found


def rule(name: str, flow: str, messages: Iterable[str], key_exprs: Iterable[str]) -> dict[str, Any]:
    """Return one access rule of Zenoh's that allows something."""
    return {
        "id": name,
        "permission": "allow",
        "flows": [flow],
        "messages": list(messages),
        "key_exprs": list(key_exprs),
    }
