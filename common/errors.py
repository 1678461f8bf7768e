"""Every error this project raises on purpose, as one tree.

```
VisionError             base; carries the exit status of the command line
├── ExpectationNotMet   1  a tool looked and found other than was expected
├── ConfigurationError  2  wrong use, wrong setting: names place, value and what is allowed
│   └── ParameterRefused   a change of live parameters that a node refused
├── SourceError         3  a source or a file cannot be opened
│   └── SourceLost         an open source stalled, froze or vanished; it is opened again
├── RouterUnreachable   4  no router answered within the time allowed
├── ToldToStop          0  told to stop while still waiting for something
└── PayloadError           bytes that are not what their key says; dropped and counted
```
"""

from __future__ import annotations


class VisionError(Exception):
    """Base of all errors that end in one clear line for the user."""

    exit_status = 1


class ExpectationNotMet(VisionError):
    """A tool did its work and found other than was expected, or nothing at all."""

    exit_status = 1


class ConfigurationError(VisionError):
    """Wrong use or wrong configuration."""

    exit_status = 2


class ParameterRefused(ConfigurationError):
    """A change of live parameters that was refused as a whole.

    Attributes:
        error: What was wrong, naming parameter and value.
        allowed: What would have been right.
    """

    def __init__(self, error: str, allowed: str) -> None:
        super().__init__(f"{error}{'' if error.endswith('?') else ';'} allowed: {allowed}")
        self.error = error
        self.allowed = allowed


class SourceError(VisionError):
    """A source or file cannot be opened or read."""

    exit_status = 3


class SourceLost(SourceError):
    """A source that was open delivers no more; opening it again may help."""


class RouterUnreachable(VisionError):
    """No Zenoh router answered within the time allowed."""

    exit_status = 4


class ToldToStop(VisionError):
    """A signal came while waiting; the process ends in order."""

    exit_status = 0


class PayloadError(VisionError):
    """A payload, header or message that must be dropped.

    Attributes:
        reason: Short name under which the drop is counted (``dropped.{reason}``).
    """

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason = reason
        self.detail = detail
