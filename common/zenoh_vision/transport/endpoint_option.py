"""The type of an option that is an endpoint; apart from endpoints.py, which loads no models."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator

from zenoh_vision.config.constraints import Form
from zenoh_vision.transport.endpoints import FORM, checked_endpoint

Endpoint = Annotated[str, AfterValidator(checked_endpoint), Form(FORM)]
