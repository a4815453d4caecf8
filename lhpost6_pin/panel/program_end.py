"""How a program that ran came to its end: by itself, by an order, by a trip or with the session."""

from .engine import Status

__all__ = ["ProgramEnd"]


class ProgramEnd:
    """Follows the states of a table from the start of a program to its end, and states that in words."""

    def __init__(self) -> None:
        """Begin while nothing runs."""
        self._name, self._time, self._cause = "", 0.0, ""
        self._ended = False

    @property
    def runs(self) -> bool:
        """Whether a program runs, is held or returns to the setpoint."""
        return bool(self._name) and not self._ended

    def show(self, status: Status | None) -> None:
        """Take the next state; None: the session has ended."""
        if status is not None and status.state != "stopped":
            if not self.runs:
                self._name, self._time, self._cause, self._ended = str(status.program), 0.0, "", False
        elif self.runs:
            self._ended = True
            if status is None:
                self._cause = "the session ended"
            elif status.trip:
                self._cause = "the table tripped"

    def stop(self, who: str) -> None:
        """Take an order to stop; the first of a program is its cause, and one without a program is nothing's."""
        if self.runs and not self._cause:
            self._cause = f"stopped by {who}"

    def pass_time(self, time: float) -> None:
        """Take the latest time on the program's own clock [s]; zero once it has ended."""
        self._time = max(self._time, time)

    def take(self) -> str | None:
        """The end in words, once, after the samples up to it have been read; None: nothing has ended."""
        if not self._ended:
            return None
        stated = f"{self._name} ended after {self._time:.1f} s: {self._cause or 'by itself'}"
        self._name, self._ended = "", False
        return stated
