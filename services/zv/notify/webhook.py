"""Posts notices to a URL, as a form with the event as JSON and the picture as a file."""

from __future__ import annotations

import json
import re
from typing import Final

import aiohttp

from zv.notify.delivery import NotTaken, Refused
from zv.notify.notice import Notice

ANSWER_S: Final = 10.0
NOT_FOR_EVER: Final = (408, 425, 429)
"""Statuses of a request that may be taken later, beside 5xx."""


class Webhook:
    """One URL.

    A receiver that took an event, but whose answer was lost, gets it again with the same
    ``Idempotency-Key``.
    """

    name = "webhook"
    shows_state = False

    def __init__(self, url: str) -> None:
        self._url = url
        self._session: aiohttp.ClientSession | None = None

    async def keep(self) -> None:
        """Do nothing: it shows no state."""

    async def send(self, notice: Notice) -> None:
        """Post a notice."""
        if self._session is None:
            self._session = aiohttp.ClientSession(timeout=aiohttp.ClientTimeout(ANSWER_S))
        form = aiohttp.FormData()
        form.add_field("event", json.dumps(notice.fields), content_type="application/json")
        if notice.picture:
            name = f"{notice.camera}.{notice.mime.rpartition('/')[2]}"
            form.add_field("picture", notice.picture, filename=name, content_type=notice.mime)
        headers = {"Idempotency-Key": notice.id}
        try:
            async with self._session.post(
                self._url, data=form, headers=headers, allow_redirects=False
            ) as answer:
                status, reason = answer.status, answer.reason
        except aiohttp.ClientResponseError as error:
            said = error.message.partition("\n")[0].rstrip(":")
            raise NotTaken(f"its answer is not HTTP: {said}") from None
        except aiohttp.InvalidURL:
            raise NotTaken("its URL names no host or no port that there is") from None
        except TimeoutError:
            raise NotTaken(f"it does not answer within {ANSWER_S:g} s") from None
        except (aiohttp.ClientError, OSError) as error:
            said = re.sub(r"https?://\S+", "its URL", str(error))  # which may hold a secret
            raise NotTaken(said or type(error).__name__) from None
        if 200 <= status < 300:
            return
        if status >= 500 or status in NOT_FOR_EVER:
            raise NotTaken(f"it answers {status} {reason}")
        raise Refused(f"it answers {status} {reason}")

    async def close(self) -> None:
        """Disconnect."""
        if self._session is not None:
            await self._session.close()
