"""Sends a request to a camera over HTTP, with its user and password, through a proxy if one is set.

Certificates are not checked, since cameras sign their own.
"""

from __future__ import annotations

import http.client
import socket
import ssl
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import unquote, urlsplit, urlunsplit

from zenoh_vision.errors import SourceError

CHUNK_BYTES: Final = 1 << 16
USER_AGENT: Final = "zenoh-vision"

STATUS_SENTENCES: Final = {
    401: "user or password is missing or wrong (401); set username and password, or write "
    "user:password@ before the host",
    403: "access is forbidden (403)",
    404: "the server has no such path (404)",
}

UNKNOWN_CHALLENGE: Final = (
    "the server asks for the password in a way that is not supported; allow Digest with MD5, or "
    "Basic, in the camera's settings"
)
NO_URL: Final = (
    "this is no valid URL: a part of its host is empty or too long, or a character must be escaped "
    "(ü is %C3%BC in a path)"
)
SHUT_EVERY_S: Final = 0.1


class HttpFailure(Exception):
    """A request failed; the text says why, without the URL."""


class TimeLimit:
    """Shuts the connection of a request that takes too long, from a thread of its own.

    A socket's own time-out begins again with each byte, so a server that sends one now and then
    would hold a reader for ever.
    """

    def __init__(self, limit_s: float) -> None:
        self.passed = False
        self._end_s = time.monotonic() + limit_s
        self._connection: http.client.HTTPConnection | None = None
        self._response: Any = None
        self._ended = threading.Event()
        threading.Thread(target=self._watch, name="deadline", daemon=True).start()

    @property
    def left_s(self) -> float:
        """Time that is left, seconds; never 0, which would mean not to wait at all."""
        return max(0.001, self._end_s - time.monotonic())

    def follow(self, connection: http.client.HTTPConnection) -> None:
        """Shut this connection if the time is over; one request may take several.

        Raises:
            TimeoutError: The time is over.
        """
        if self.passed:
            raise TimeoutError
        self._connection = connection

    def follow_answer(self, response: Any) -> None:
        """Shut the connection of this answer, which owns it from now on."""
        self._response = response

    def end(self) -> None:
        """Let the answer last for as long as it likes; safe to call twice."""
        self._ended.set()

    def _watch(self) -> None:
        wait_s = self.left_s
        while not self._ended.wait(wait_s):  # a connection may be made only after the first time
            self.passed = True
            wait_s = SHUT_EVERY_S
            for found in (getattr(self._connection, "sock", None), _socket_of(self._response)):
                if found is not None:
                    with suppress(OSError):
                        found.shutdown(socket.SHUT_RDWR)


def _socket_of(response: Any) -> Any:
    """Return the socket from which an answer is read; None if it is closed."""
    return getattr(getattr(getattr(response, "fp", None), "raw", None), "_sock", None)


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a request, whose body is read piece by piece.

    Attributes:
        kind: Its media type in lower case, without parameters: ``image/jpeg``.
        response: Its body.
        timeout_s: Longest time without a byte.
        limit: The time for the whole answer, until it is ended.
        name: Who answered, for people.
    """

    kind: str
    response: Any
    timeout_s: float
    limit: TimeLimit
    name: str = "the server"

    def read(self) -> bytes:
        """Return the next bytes as soon as there are some; empty at the end.

        Raises:
            HttpFailure: The connection broke, or nothing came in time.
        """
        return self._found(self.response.read1, CHUNK_BYTES)

    def peek(self) -> bytes:
        """Return the first bytes, which are to come again.

        Raises:
            HttpFailure: As ``read``.
        """
        return self._found(self.response.peek, 4)

    def _found(self, read: Callable[[int], bytes], size: int) -> bytes:
        try:
            found = bytes(read(size))
        except http.client.IncompleteRead:
            found = b""
        except (OSError, ValueError, http.client.HTTPException) as error:
            raise self._failure(error) from None
        if self.limit.passed:
            raise self._failure(TimeoutError())
        return found

    def _failure(self, error: Exception) -> HttpFailure:
        cause = TimeoutError() if self.limit.passed else error
        return HttpFailure(connection_sentence(cause, self.timeout_s))

    def chunks(self) -> Iterator[bytes]:
        """Yield the bytes of the body as they come.

        Raises:
            HttpFailure: As ``read``.
        """
        while chunk := self.read():
            yield chunk

    def why_ended(self) -> str:
        """Return why the body has ended, for people."""
        return "the server ended the stream"

    def interrupt(self) -> None:
        """End a ``read`` that waits on another thread."""
        connection = _socket_of(self.response)
        if connection is not None:
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close the connection."""
        self.limit.end()
        with suppress(OSError):
            self.response.close()


class _Unread(urllib.request.BaseHandler):
    """Closes the answer that asks for a password, which those that send it leave open."""

    handler_order = 100  # before them

    def http_error_401(self, _request: Any, answer: Any, *_details: Any) -> None:
        answer.close()


class _Limited(urllib.request.AbstractHTTPHandler):
    """Makes the connections of a request, also those after a redirect, within its time."""

    limit: TimeLimit

    def do_open(self, http_class: Any, req: urllib.request.Request, **http_conn_args: Any) -> Any:
        def made(host: str, **how: Any) -> http.client.HTTPConnection:
            connection: http.client.HTTPConnection = http_class(
                host, **{**how, "timeout": self.limit.left_s}
            )
            self.limit.follow(connection)
            return connection

        response = super().do_open(made, req, **http_conn_args)
        self.limit.follow_answer(response)
        return response


class _Http(_Limited, urllib.request.HTTPHandler):
    pass


class _Https(_Limited, urllib.request.HTTPSHandler):
    pass


class HttpClient:
    """Requests one URL, as often as wanted.

    Args:
        url: ``http://`` or ``https://``, perhaps with ``user:password@``.
        timeout_s: Longest time for an answer, of which a stream's body is no part, and longest time
            without a byte.
    """

    def __init__(self, url: str, timeout_s: float) -> None:
        parts = urlsplit(url)
        host = parts.netloc.rpartition("@")[2]
        self._url = urlunsplit(parts._replace(scheme=parts.scheme.lower(), netloc=host))
        self._timeout_s = timeout_s
        passwords = urllib.request.HTTPPasswordMgrWithDefaultRealm()
        handlers: list[urllib.request.BaseHandler] = []
        if parts.username is not None:
            user, password = unquote(parts.username), unquote(parts.password or "")
            passwords.add_password(None, self._url, user, password)
            handlers = [
                _Unread(),
                urllib.request.HTTPDigestAuthHandler(passwords),
                urllib.request.HTTPBasicAuthHandler(passwords),
            ]
        context = ssl.create_default_context()
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
        self._limited: tuple[_Limited, ...] = (_Http(), _Https(context=context))
        self._opener = urllib.request.build_opener(*self._limited, *handlers)
        self._opener.addheaders = [("User-Agent", USER_AGENT)]

    def get(self) -> Answer:
        """Send the request, and return the answer once its header is there.

        Its body must come within the time too, unless the answer's limit is ended.

        Raises:
            HttpFailure: It was refused, or nobody answers.
        """
        limit = TimeLimit(self._timeout_s)
        for each in self._limited:
            each.limit = limit
        try:
            response = self._response()
        except BaseException as error:
            limit.end()
            if limit.passed and isinstance(error, HttpFailure):
                raise HttpFailure(self._sentence(TimeoutError())) from None
            raise
        connection = _socket_of(response)
        if connection is not None:
            connection.settimeout(self._timeout_s)
        kind = response.headers.get_content_type().lower()
        return Answer(kind, response, self._timeout_s, limit)

    def _response(self) -> Any:
        try:
            return self._opener.open(self._url, timeout=self._timeout_s)
        except urllib.error.HTTPError as error:
            error.close()
            raise HttpFailure(status_sentence(error.code)) from None
        except urllib.error.URLError as error:
            if not isinstance(error.reason, Exception):
                raise HttpFailure(str(error.reason)) from None
            raise HttpFailure(self._sentence(error.reason)) from None
        except UnicodeError:
            raise HttpFailure(NO_URL) from None
        except ValueError:  # urllib's, for a way to ask for a password that it does not know
            raise HttpFailure(UNKNOWN_CHALLENGE) from None
        except (OSError, http.client.HTTPException) as error:
            raise HttpFailure(self._sentence(error)) from None

    def _sentence(self, error: Exception) -> str:
        return connection_sentence(error, self._timeout_s) + proxy_words(self._url)


def status_sentence(code: int) -> str:
    """Return what a status of HTTP means, for people."""
    if code in STATUS_SENTENCES:
        return STATUS_SENTENCES[code]
    return (
        f"the server refused the request ({code})" if code < 500 else f"the server failed ({code})"
    )


def connection_sentence(error: Exception, timeout_s: float) -> str:
    """Return why a connection failed, for people; never the URL."""
    if isinstance(error, TimeoutError):
        return f"no usable picture from the server for {timeout_s:g} s"
    if isinstance(error, ConnectionRefusedError):
        return "nobody listens there (connection refused)"
    if isinstance(error, ConnectionResetError | BrokenPipeError):
        return "the server closed the connection"
    if isinstance(error, http.client.BadStatusLine | http.client.LineTooLong):
        return "the server does not speak HTTP"
    if isinstance(error, http.client.InvalidURL):
        return NO_URL
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return f"{type(error).__name__}"


def proxy_words(url: str) -> str:
    """Return which proxy a request to a URL takes; empty if none."""
    parts = urlsplit(url)
    proxy = urllib.request.getproxies().get(parts.scheme.lower())
    if not proxy or urllib.request.proxy_bypass(parts.hostname or ""):
        return ""
    shown = proxy.rpartition("@")[2]
    variable = f"{parts.scheme.lower()}_proxy"
    return (
        f"; it was asked for through the proxy {shown} of {variable}: name the camera in no_proxy, "
        "if it is to be reached without"
    )


def check_authority(url: str, shown: str) -> None:
    """Check that a password in a URL has no character that ends it.

    Raises:
        SourceError: It has; the text says what to write.
    """
    rest = url.partition("://")[2]
    ends = [rest.find(mark) for mark in "/?#" if mark in rest]
    authority = rest[: min(ends)] if ends else rest
    _, colon, after = authority.partition(":")
    if "@" in authority or "@" not in rest or not colon or after.isdecimal():
        return
    raise SourceError(
        f"{shown}: a password with / ? or # must be written with %2F %3F or %23 in a URL; or set "
        "username, and the password in ZV_CAMERA_PASSWORD or password_file, where it is as it is"
    )
