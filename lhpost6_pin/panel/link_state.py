"""State of the link between a panel and its plant, as the page shows it."""

from typing import Any

from ..machine.parameters import Parameters
from .timekeeping import Timekeeping

__all__ = ["link_state"]

_SLOW = "This computer is too slow for real time: close other programs"
_PACE = ", or start the panel with --pace 0.5. Motion and recordings are not affected"


def link_state(word: str, time: Timekeeping, server: str, own: bool, numbers: Parameters) -> dict[str, Any]:
    """Counts, and the line and the title that the page shows of them.

    `word`: off, on or lost; `own`: whether the plant is the panel's, whose clock waits for commands and has a pace.
    """
    late = time.share
    share = f"{100.0 * late:.2g} % late" if late < 0.1 else f"{100.0 * late:.0f} % late"
    slow = late >= numbers.number("link.slow")
    if word == "on":
        on_time = late < numbers.number("link.on_time")
        text = f"! slow computer: {share}" if slow else "✓ on time" if on_time else f"✓ {share}"
    else:
        text = f"! lost, {share}" if word == "lost" else "closed" if time.answered else "not connected yet"
    holds = f"{time.holds} safe hold{'' if time.holds == 1 else 's'}"
    title = f"Server {server}: {time.answered} samples, {100.0 * late:.3f} % of them late, {holds}"
    if slow:
        title = f"{title}. {_SLOW}{_PACE if own else ''}."
    return {
        "ok": word == "on",
        "word": word,
        "late": late,
        "samples": time.answered,
        "holds": time.holds,
        "text": text,
        "title": title,
    }
