"""Operators whose connection was lost: what the same page is informed of once it is back."""

__all__ = ["LostOperators"]


class LostOperators:
    """Losses of the controls by the key that a page states in all its connections; only the last of each is kept."""

    def __init__(self) -> None:
        """Begin with none."""
        self._losses: dict[str, tuple[str, str | None]] = {}

    def add(self, key: str, time: str, program: str | None) -> None:
        """Note that an operator's connection ended, and which program was stopped by it; a page without key is none."""
        if key:
            self._losses[key] = time, program

    def take(self, key: str, operator: str | None) -> str | None:
        """What the page of a key is to be informed of, once; `operator`: who has the controls now."""
        if key not in self._losses:
            return None
        time, program = self._losses.pop(key)
        stopped = f"the program {program} was stopped, and " if program else ""
        free = "the controls are free: take them again" if operator is None else f"{operator} has the controls now"
        return f"Your connection was lost at {time}; {stopped}{free}."
