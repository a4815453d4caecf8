"""A browser of a panel, as the session knows it."""

from collections.abc import Callable

__all__ = ["Client"]


class Client:
    """A browser: its number, the name of its user, and how it is informed of a refused order and of a lost connection.

    Attribute `key`: what its page calls itself in all its connections; empty until the page states it.
    """

    def __init__(self, number: str, refuse: Callable[[str], None], notify: Callable[[str], None]) -> None:
        """Join as a watcher."""
        self.number, self.name, self.refuse, self.notify = number, f"guest {number}", refuse, notify
        self.key = ""

    def explain(self, error: BaseException) -> None:
        """Refuse with the reason that an error states; an error of no message is one of the page."""
        page = isinstance(error, (KeyError, TypeError, ValueError))
        strange = f"the page sent what the panel does not understand: {error!r}; load the page again"
        self.refuse(strange if page else str(error))
