"""All errors that this project raises on purpose, each with the command line's exit status."""

from __future__ import annotations


class VisionError(Exception):
    """Base of all errors that end in one clear line for the user."""

    exit_status = 1


class ExpectationNotMet(VisionError):
    """A tool found nothing, or not what was expected."""


class ConfigurationError(VisionError):
    """Wrong usage or configuration."""

    exit_status = 2


class ParameterRefused(ConfigurationError):
    """A change of live parameters that was refused as a whole.

    Attributes:
        error: What was wrong, with parameter and value.
        allowed: The values that are allowed.
    """

    def __init__(self, error: str, allowed: str) -> None:
        super().__init__(f"{error}{'' if error.endswith('?') else ';'} allowed: {allowed}")
        self.error = error
        self.allowed = allowed


class SourceError(VisionError):
    """A source or file cannot be opened, read or written."""

    exit_status = 3


class SourceLost(SourceError):
    """An open source stopped delivering; opening it again may help."""


class RouterUnreachable(VisionError):
    """No Zenoh router answered within the time allowed."""

    exit_status = 4


class ConnectionFault(RouterUnreachable):
    """The connection to a router is configured wrongly: its name, a certificate or a clock."""

    exit_status = ConfigurationError.exit_status


class ToldToStop(VisionError):
    """A signal arrived during a wait; the process ends normally."""

    exit_status = 0


class PayloadError(VisionError):
    """A payload, header or message that must be dropped.

    Attributes:
        reason: The drop is counted as ``dropped.{reason}``.
    """

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason = reason
        self.detail = detail
