"""The tokens of the two scopes, and the sessions that browsers keep instead of a token."""

from __future__ import annotations

import base64
import functools
import hashlib
import hmac
import math
import secrets
from dataclasses import dataclass
from enum import StrEnum

SESSION_S = 30 * 86400
"""A session ends this long after the address with the token was opened."""


class Scope(StrEnum):
    """The permissions of a client."""

    VIEW = "view"  # read everything
    CONTROL = "control"  # and set parameters


@dataclass(frozen=True, slots=True)
class Principal:
    """The sender of a request: its permissions, and its name in the log."""

    scope: Scope
    name: str
    end_s: float = math.inf  # when the session ends, in s since 1970

    def forbidden(self, now_s: float) -> str:
        """Return why it must not set parameters now; empty if it may."""
        if self.scope is not Scope.CONTROL:
            return f"the scope {Scope.CONTROL} is missing: this page has the scope {self.scope}"
        return "the session has ended" if self.end_s <= now_s else ""


NO_TOKEN = Principal(Scope.CONTROL, "no token needed")


def view_token(token: str) -> str:
    """Return the token that only permits viewing, derived from the one that permits control.

    It is the same after each start, so that addresses with it remain valid.
    """
    return _sign(token, "token", Scope.VIEW)


def scope_of(text: str, token: str) -> Scope | None:
    """Return the scope that a text permits as a token, if any; compared in constant time."""
    if _equal(text, token):
        return Scope.CONTROL
    return Scope.VIEW if _equal(text, view_token(token)) else None


def new_session(scope: Scope, token: str, now_s: float) -> str:
    """Return the text of a cookie for a new session that begins now, in s since 1970.

    It is signed, not stored: sessions survive a restart, need no limit in number, and end when
    the token is changed.
    """
    session = f"{secrets.token_hex(4)}.{scope}.{int(now_s) + SESSION_S}"
    return f"{session}.{_sign(token, 'session', session)}"


def token_principal(text: str, token: str) -> Principal | None:
    """Return the sender of a request with this token; None if the text is neither of the two."""
    scope = scope_of(text, token)
    return None if scope is None else Principal(scope, f"token ({scope})")


def session_principal(text: str, token: str, now_s: float) -> Principal | None:
    """Return the sender of a request with this session; None if it is not valid, or has ended."""
    session, _, signature = text.rpartition(".")
    if not _equal(signature, _sign(token, "session", session)):
        return None
    name, scope_name, end_s = session.split(".")
    if int(end_s) <= now_s:
        return None
    return Principal(Scope(scope_name), f"session {name} ({scope_name})", int(end_s))


def _sign(token: str, kind: str, text: str) -> str:
    """Return the signature of a text, which is not valid for the same text of another kind."""
    data = f"{kind} {text}".encode(errors="surrogateescape")
    digest = hmac.digest(_key(token), data, "sha256")
    return base64.urlsafe_b64encode(digest[:24]).decode()


@functools.cache
def _key(token: str) -> bytes:
    """Return the key of all signatures: slow, so that a view token does not help to guess ours."""
    return hashlib.scrypt(token.encode(), salt=b"zenoh-vision viewer", n=1 << 14, r=8, p=1)


def _equal(text: str, known: str) -> bool:
    given = text.encode(errors="surrogateescape")  # a header may hold any byte
    return hmac.compare_digest(given, known.encode())
