"""Errors that a user can act on: each message names the file, channel or key and says what to do."""

from collections.abc import Sequence
from difflib import get_close_matches

__all__ = [
    "ControllerError",
    "LhpostError",
    "LinkError",
    "MotionError",
    "OutOfRangeError",
    "ParameterError",
    "RecordError",
    "SimulationError",
    "UnknownNameError",
    "instead_of",
    "meant",
]

_FEW = 12
"""So many names are listed even where the one that was meant is likely among the nearest."""


class LhpostError(Exception):
    """Base of all errors raised on purpose by this package; the command line prints it without a traceback."""


class ParameterError(LhpostError):
    """A machine or controller file has a missing, unknown or impossible value; the message names the key."""


class ControllerError(LhpostError):
    """A user's own controller cannot be loaded, or returned no command; the message names it and the sample."""


class LinkError(LhpostError):
    """A link cannot be opened, does not respond, or a datagram is malformed; the message gives place and remedy."""


class RecordError(LhpostError):
    """A test record cannot be read or lacks what was asked of it; the message names file, channel and sample."""


class MotionError(LhpostError):
    """A ground-motion file or description cannot be understood; the message names file and line."""


class OutOfRangeError(LhpostError):
    """A motion asks for more than the machine can give; the message says which limit and the scale that fits."""

    def __init__(self, message: str, largest_scale: float | None = None) -> None:
        """Keep the scale that would fit, where one is known."""
        super().__init__(message)
        self.largest_scale = largest_scale


class SimulationError(LhpostError):
    """A run cannot be started as asked, or it diverged; the message names time and component."""


class UnknownNameError(LhpostError):
    """A name is not one of those that exist; the message says which are near, and which are valid."""

    def __init__(self, kind: str, name: str, valid: Sequence[str], listing: str = "") -> None:
        """Say that `name` is no `kind`, and what to write `instead_of` it."""
        super().__init__(f"no {kind} named {name!r}; {instead_of(name, sorted(valid), listing)}")


def instead_of(name: str, valid: Sequence[str], listing: str = "") -> str:
    """Say what to write instead of a name that is not `valid`: the nearest ones, and all unless they are many.

    `listing` says where many are listed, as in "`lhpost6 motions` lists them".
    """
    if not valid:
        return "there are none"
    near, everything = meant(name, valid), f"valid names: {', '.join(valid)}"
    if len(valid) <= _FEW or not (near or listing):
        return near + everything
    return (near + listing).rstrip()


def meant(name: str, valid: Sequence[str]) -> str:
    """Ask whether one of the `valid` names nearest to this one was meant; "" where none is near."""
    spelled = {known.lower(): known for known in valid}
    near = [repr(spelled[known]) for known in get_close_matches(name.lower(), spelled)]
    return f"did you mean {' or '.join(near)}? " if near else ""
