"""Work beside the main thread of a command, while that waits or runs compiled code, which releases the interpreter."""

import threading
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module

__all__ = ["beside", "import_all"]


def beside(function: Callable[..., object], *arguments: object) -> None:
    """Start a function that prepares what is needed later, in a thread.

    Its errors are passed over: they are raised again where the same is needed. A process that ends waits for it: to end
    a thread within the initialisation of a library aborts the process.
    """

    def run() -> None:
        with suppress(Exception):
            function(*arguments)

    threading.Thread(target=run, name=function.__name__).start()


def import_all(*modules: str) -> None:
    """Import modules by name; an import of one of them elsewhere waits for this one."""
    for name in modules:
        import_module(name)
