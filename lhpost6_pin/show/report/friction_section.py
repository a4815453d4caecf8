"""Friction in a calibration's report: forms compared by their error on held-out tests."""

from ...identification.calibration import Calibration
from ...identification.calibration.calibration_summary import friction_summary
from .page import Block, Table, number
from .scales import percent

__all__ = ["friction_blocks", "friction_table"]


def friction_table(calibration: Calibration) -> Table | None:
    """Return the error of every form of friction on every held-out test; None where they were not compared."""
    found = calibration.friction
    if found is None:
        return None
    titles = [f"{'◆ ' * (form is found.best)}{form.title}" for form in found.forms]
    rows: list[tuple[str, ...]] = [
        (test, *(f"{number(f.explained[t], 3)} ({percent(f.error[t])})" for f in found.forms))
        for t, test in enumerate(found.tests)
    ]
    rows.append(("mean", *(f"{number(f.explained.mean(), 3)} ({percent(f.error.mean())})" for f in found.forms)))
    rows.append(("numbers fitted", *(str(f.numbers) for f in found.forms)))
    return Table("Forms of friction: R² of the force on held-out tests (RMS error over force)", ("Test", *titles), rows)


def friction_blocks(calibration: Calibration) -> list[Block]:
    """Return the comparison of forms of friction, with what it means."""
    table = friction_table(calibration)
    if table is None:
        why = "Not compared: needs a platen on guides with friction, a measured force, and three tests or more."
        return [why]
    how = (
        "Each test is predicted by a fit to all others, of friction with the mass and viscous force that it is "
        "confused with, by plain least squares of the force. "
        f"{friction_summary(calibration)}"
    )
    return [how, table]
