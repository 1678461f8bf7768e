"""The options of every service that limit its use of the CPU."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import AfterValidator, Field

from zenoh_vision.config.constraints import Form
from zenoh_vision.config.settings import Settings, Text
from zenoh_vision.host.parallel import MAX_BY_DEFAULT, MAX_THREADS, workers
from zenoh_vision.host.processors import processors_of, use_processors


def _checked(text: str) -> str:
    processors_of(text)
    return text


Threads = Annotated[
    int,
    Field(
        ge=0,
        le=256,
        description="threads that an OpenCV or NumPy call may use; 0: one per processor",
    ),
]
JpegThreads = Annotated[
    int,
    Field(
        ge=0,
        le=MAX_THREADS,
        description="threads that encode one JPEG of over 400,000 pixels, or decode one of "
        f"800,000; 0: one per processor, at most {MAX_BY_DEFAULT}",
    ),
]
Nice = Annotated[
    int,
    Field(ge=-20, le=19, description="niceness: higher values get less CPU time on a busy machine"),
]
Affinity = Annotated[
    Text | None,
    AfterValidator(lambda text: text if text is None else _checked(text)),
    Field(description="processors that the process may run on; not set: all"),
    Form("processors such as 0,2-3"),
]


class ProcessorSettings(Settings):
    """How much CPU a service may use.

    One thread of OpenCV and NumPy by default: theirs busy-wait for each other, so a call on two
    threads takes more CPU time than on one, and several services share a machine. The threads for
    JPEGs do not, and make large pictures faster.
    """

    env_prefix: ClassVar[str] = "ZV_"
    env_shared: ClassVar[bool] = True

    threads: Threads = 1
    jpeg_threads: JpegThreads = 0
    nice: Nice = 0
    affinity: Affinity = None

    def apply(self) -> None:
        """Limit this process to them.

        Raises:
            ConfigurationError: The machine does not allow it.
        """
        use_processors(
            self.threads, self.nice, processors_of(self.affinity) if self.affinity else ()
        )
        workers.limit(self.jpeg_threads)
