"""Errors that a user can correct: each message names the file, channel or key and the remedy."""

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
"""Up to this number, all valid names are listed even beside near matches."""


class LhpostError(Exception):
    """Base of all errors raised on purpose by this package; the command line prints it without a traceback."""


class ParameterError(LhpostError):
    """A machine or controller file has a missing, unknown or impossible value; the message names the key."""


class ControllerError(LhpostError):
    """A user's own controller cannot be loaded or returned no command; the message names it and the sample."""


class LinkError(LhpostError):
    """A link cannot be opened, does not respond, or a datagram is malformed; the message gives place and remedy."""


class RecordError(LhpostError):
    """A test record cannot be read or lacks a channel; the message names file, channel and sample."""


class MotionError(LhpostError):
    """A ground-motion file or description is invalid; the message names file and line."""


class OutOfRangeError(LhpostError):
    """A motion exceeds the capacity of the machine; the message names the limit and the largest scale that fits."""

    def __init__(self, message: str, largest_scale: float | None = None, exceeded: tuple[str, ...] = ()) -> None:
        """`largest_scale`: the scale that fits, if known; `exceeded`: the quantities beyond their limits."""
        super().__init__(message)
        self.largest_scale, self.exceeded = largest_scale, exceeded


class SimulationError(LhpostError):
    """The options or drive of a run are invalid, or the run diverged; the message names time and component."""


class UnknownNameError(LhpostError):
    """A name does not exist; the message lists near matches and valid names."""

    def __init__(self, kind: str, name: str, valid: Sequence[str], listing: str = "") -> None:
        """`kind` and `name` as in "no motion named 'x'"; `valid` and `listing` as for `instead_of`."""
        super().__init__(f"no {kind} named {name!r}; {instead_of(name, sorted(valid), listing)}")


def instead_of(name: str, valid: Sequence[str], listing: str = "") -> str:
    """Valid names in place of an unknown one, for a message: the nearest ones, and all unless they are many.

    `listing` refers to a list of many names, as in "`lhpost6 motions` lists them".
    """
    if not valid:
        return "there are none"
    near, everything = meant(name, valid), f"valid names: {', '.join(valid)}"
    if len(valid) <= _FEW or not (near or listing):
        return near + everything
    return (near + listing).rstrip()


def meant(name: str, valid: Sequence[str]) -> str:
    """Question for a message, "did you mean ...? ", with the `valid` names nearest to this one; "" if none is near."""
    spelled = {known.lower(): known for known in valid}
    near = [repr(spelled[known]) for known in get_close_matches(name.lower(), spelled)]
    return f"did you mean {' or '.join(near)}? " if near else ""
