"""Reports in a node's health and log what its certificate does not allow, and when it ends."""

from __future__ import annotations

import logging
from typing import Final

from zenoh_vision.errors import VisionError
from zenoh_vision.health.health import Health
from zenoh_vision.messages import Level
from zenoh_vision.security.credentials import (
    Credentials,
    file_state,
    read_credentials,
    without_clock,
)
from zenoh_vision.transport.access import AccessCheck
from zenoh_vision.transport.link import Link

log = logging.getLogger(__name__)

DENIED: Final = "access"
VALIDITY: Final = "certificate"


class CertificateCheck:
    """Watches a node's rights and the validity of its certificate.

    The credentials of a changed file take the place of those with which it connected. The health is
    told of what is denied, and of an end within 30 days.
    """

    def __init__(self, link: Link, credentials: Credentials, health: Health) -> None:
        self._access = AccessCheck(link, credentials)
        self._credentials = credentials
        self._health = health
        self._state: tuple[int, ...] | None = ()  # so that the first look reads what came since
        self._unusable = ""

    def check(self, announces: str) -> None:
        """Look again, and report what has changed; call about once a second.

        Args:
            announces: Key of the node's token.
        """
        self._follow_file()
        self._access.check(announces)
        denied = self._access.denied
        if denied != self._health.message(DENIED):
            self._health.report(DENIED, Level.ERROR if denied else Level.OK, denied)
            log.log(logging.ERROR if denied else logging.WARNING, "%s", denied or "denied no more")
        validity = self._credentials.validity
        ended, ending = validity.fault(), validity.warning()
        words = ended or self._unusable or ending
        level = Level.ERROR if ended else Level.WARN if words else Level.OK
        if without_clock(words) != without_clock(self._health.message(VALIDITY)):
            self._health.report(VALIDITY, level, words)
            if words:
                log.log(logging.ERROR if ended else logging.WARNING, "%s", words)

    def _follow_file(self) -> None:
        """Take the credentials in the file if it was changed, as the next connection does."""
        state = file_state(self._credentials.path)
        if state == self._state:
            return
        self._state = state
        try:
            self._credentials = read_credentials(str(self._credentials.path))
        except VisionError as error:
            self._unusable = f"the next connection will fail: {error}"
        else:
            self._unusable = ""
            self._access.credentials = self._credentials
