"""What rich draws, as text."""

from rich.console import Console, RenderableType


def rendered(shown: RenderableType) -> str:
    """Return the text on a wide terminal without colours."""
    console = Console(width=200, color_system=None)
    with console.capture() as capture:
        console.print(shown)
    return capture.get()
