"""The console for tables."""

from rich.console import Console

__all__ = ["make_console"]


def make_console() -> Console:
    """Console as wide as the terminal, and wide enough for tables where the output is a file or a pipe."""
    return Console() if Console().is_terminal else Console(width=160)
