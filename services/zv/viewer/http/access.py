"""Checks requests: by host, site of origin, and token or session."""

from __future__ import annotations

import re
import socket
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

from aiohttp import web

from zv.viewer.credentials import (
    NO_TOKEN,
    SESSION_S,
    Principal,
    Scope,
    new_session,
    scope_of,
    session_principal,
    token_principal,
)
from zv.viewer.http.listener import is_address, is_loopback
from zv.viewer.http.tls import Holders

COOKIE = "zv_token"
NAME = re.compile(r"[a-z0-9_.-]{1,100}")
PORT = re.compile(r":([0-9]{1,5})$")
PUBLIC_PATHS = ("/healthz",)
"""Paths that need no token."""

SECURITY_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}


@dataclass(frozen=True, slots=True)
class Access:
    """The access rules of one viewer."""

    token: str | None = field(repr=False)  # None: not required; only loopback names are served
    names: frozenset[str]  # under which the viewer is served, besides IP addresses
    base_path: str = ""  # below which all is served too, for a proxy that does not remove it
    holders: Holders | None = None  # whose certificates replace a token

    def check(self, request: web.Request) -> None:
        """Raise HTTPForbidden or HTTPUnauthorized for a wrong host, origin or token."""
        host = request.headers.get("Host")
        self.check_host(host)
        if "Upgrade" in request.headers or request.method not in ("GET", "HEAD"):
            self.check_origin(request.headers.get("Origin"), host)
        elif not any(map(self.scope_of, tokens_in(request))):
            self.check_site(request.headers, host)
        if request.path.removeprefix(self.base_path) not in PUBLIC_PATHS:
            self.principal(request)

    def principal(self, request: web.Request) -> Principal:
        """Return the sender of a request; raise as ``check_token``."""
        cookie = request.cookies.get(cookie_name(request.headers.get("Host")))
        return self.check_token(tokens_in(request), cookie, certificate_of(request))

    def check_host(self, host: str | None) -> None:
        """Raise HTTPForbidden for an unknown ``Host``: any name may resolve to this machine.

        Others on the network can answer for this machine's own name too, so a request
        by that name needs a token.
        """
        name = host_name(host or "")
        if is_loopback(name) or (self.guarded and (name in self.names or is_address(name))):
            return
        shown = name if NAME.fullmatch(name) else "NAME"
        proof = "" if self.holders is not None else " with a token"
        raise web.HTTPForbidden(
            text=f"host {host!r} is not served here; --allow-host {shown} allows it{proof}\n"
        )

    def check_origin(self, origin: str | None, host: str | None) -> None:
        """Raise HTTPForbidden for an ``Origin`` of another site; programs send none."""
        if origin is None:
            return
        try:
            site = urlsplit(origin).netloc.lower()
        except ValueError:
            site = ""
        if site != (host or "").lower():
            raise web.HTTPForbidden(
                text=f"a page of {origin!r} may not request this; allowed: a page of {host!r}\n"
            )

    def check_site(self, headers: Mapping[str, str], host: str | None) -> None:
        """Raise HTTPForbidden for resources that a page of another site loads, except by a link."""
        sent = headers.get("Sec-Fetch-Mode"), headers.get("Sec-Fetch-Dest")
        if sent == ("navigate", "document"):  # navigation of a whole tab
            return
        self.check_origin(headers.get("Origin"), host)
        if headers.get("Sec-Fetch-Site") == "cross-site":
            raise web.HTTPForbidden(
                text="a page of another site may load this only with ?token=TOKEN; see --token\n"
            )

    def check_token(
        self,
        tokens: Iterable[str | None],
        session: str | None,
        certificate: Mapping[str, Any] | None = None,
    ) -> Principal:
        """Return the sender of these tokens, this session and certificate, of the widest scope.

        Raise HTTPUnauthorized unless one is valid, HTTPForbidden if only a certificate is needed. A
        token does not count as a session, nor the reverse.
        """
        if not self.guarded:
            return NO_TOKEN
        found: list[Principal | None] = []
        if self.token is not None:
            given = [text for text in tokens if text is not None]
            found = [token_principal(text, self.token) for text in given]
            if session is not None:
                found.append(session_principal(session, self.token, time.time()))
        if self.holders is not None and certificate:
            found.append(self.holders.principal(certificate))
        known = [who for who in found if who is not None]
        if known:
            return max(known, key=lambda who: who.scope is Scope.CONTROL)
        if self.token is None:
            said = (
                "it has ended, or the name in it has no rights here"
                if found
                else "the browser has none"
            )
            raise web.HTTPForbidden(
                text=f"a certificate is required, and {said}: see --tls-clients, --tls-operators "
                "and --tls-guests\n"
            )
        wrong = "the token is wrong, or the session has ended"
        raise web.HTTPUnauthorized(
            text=f"{wrong if found else 'a token is required'}: "
            "open the address that `zv view` prints, or add ?token=TOKEN\n",
            headers={"WWW-Authenticate": "Bearer"},
        )

    @property
    def guarded(self) -> bool:
        """Whether a token or a certificate is needed."""
        return self.token is not None or self.holders is not None

    def scope_of(self, text: str | None) -> Scope | None:
        """Return the scope of a token; None if a text is not a token."""
        return None if self.token is None or text is None else scope_of(text, self.token)

    def redirect(self, request: web.Request) -> web.Response | None:
        """Return the redirect that replaces the token in a page's address by a session.

        The token does not stay in the address bar and the history. None if there is no token.
        """
        scope = self.scope_of(request.query.get("token"))
        if scope is None or self.token is None:
            return None
        # Relative, since a proxy may serve this under a path of its own.
        url = request.rel_url.without_query_params("token")
        place = (url.name or "./") + (f"?{url.raw_query_string}" if url.raw_query_string else "")
        response = web.Response(
            status=303, headers={"Location": place, "Cache-Control": "no-store"}
        )
        response.set_cookie(
            cookie_name(request.headers.get("Host")),
            new_session(scope, self.token, time.time()),
            max_age=SESSION_S,
            # Set by a TLS proxy. A client that invents it only loses its own session.
            secure=request.secure
            or request.headers.get("X-Forwarded-Proto", "").lower().startswith("https"),
            httponly=True,
            samesite="Lax",  # with Strict, a link on another site could not open the page
        )
        return response


def tokens_in(request: web.Request) -> tuple[str | None, str | None]:
    """Return the tokens of a request: in its URL and in ``Authorization``."""
    kind, _, bearer = request.headers.get("Authorization", "").partition(" ")
    return request.query.get("token"), bearer if kind.lower() == "bearer" else None


def certificate_of(request: web.Request) -> Mapping[str, Any] | None:
    """Return the certificate of a browser, which TLS has verified; None or empty without one."""
    transport = request.transport
    return None if transport is None else transport.get_extra_info("peercert")


def host_name(host: str) -> str:
    """Return the name or address in a ``Host`` header, without its port, in lower case."""
    host = host.strip().lower()
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0].removesuffix(".")


def cookie_name(host: str | None) -> str:
    """Return the name of the cookie that holds a session of the viewer at a host and port.

    Browsers send a host's cookies to all its ports, so two viewers on one machine need different
    names. The port is that of the ``Host`` header ``host``: outside of a container it differs
    from the port that the viewer listens on.
    """
    port = PORT.search((host or "").strip())
    return f"{COOKIE}_{port[1]}" if port else COOKIE


def own_names(host: str, allowed: Iterable[str]) -> frozenset[str]:
    """Return the names of a viewer that listens on a host: its own, and those allowed."""
    own = socket.gethostname().lower()
    return frozenset({own, f"{own.partition('.')[0]}.local", host.lower(), *allowed})
