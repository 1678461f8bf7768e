"""Cameras that are opened by their URLs, and closed at the end of a test."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from tests.support.pictures.url_sources import PATIENT_S, Opened
from zv.camera.sources.base import Source
from zv.camera.sources.url import UrlOptions, open_url


@pytest.fixture
def opened() -> Iterator[Opened]:
    """Opens cameras, without hardware for them."""
    with ExitStack() as sources:

        def open_it(url: str, timeout_s: float = PATIENT_S, **options: object) -> Source:
            source = open_url(url, UrlOptions(timeout_s, **{"hwaccel": "none", **options}))
            sources.callback(source.close)
            return source

        yield open_it
