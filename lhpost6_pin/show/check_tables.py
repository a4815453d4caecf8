"""Tables of `lhpost6 check` for a campaign: its tests, noise, disagreement of redundant sensors, what sensors tell."""

import math
from collections.abc import Sequence
from typing import Any

from ..core.names import AXES
from ..data.campaign_check import CampaignCheck
from ..data.metrics import QUANTITIES
from ..data.summary import RecordSummary
from .report.page import Table
from .tables import print_sensor_findings
from .terminal import print_blocks

__all__ = ["check_entries", "print_check", "print_contradictions", "print_tests", "campaign_entries"]

VERDICTS = {"yes": "yes", "ratio": "partly", "no": "no"}


def check_entries(found: CampaignCheck | None) -> dict[str, Any]:
    """What a campaign's sensors show, for `--json`."""
    if found is None:
        return {"sensors": None, "noise": None, "observable": None}
    noise = {one.channel: {**one._asdict(), "ratio": one.ratio, "warning": one.warning} for one in found.noise}
    return {
        "sensors": found.findings,
        "noise": {"rest_seconds": found.rest, "source": found.source, "rate_hz": found.rate, "channels": noise},
        "noise_warnings": found.warnings,
        "contradictions": found.contradictions,
        "observable": found.observable,
    }


def print_check(found: CampaignCheck) -> None:
    """Print the noise with its warnings, the sensors that disagree, and what these sensors can tell."""
    rows = [
        (
            *(one.channel, one.unit, f"{one.measured:.3g}"),
            *("" if math.isnan(x) else f"{x:.3g}" for x in (one.stated, one.ratio)),
            "" if math.isinf(one.corner) else f"{one.corner:.0f}",
            f"{one.step:.2g}",
        )
        for one in found.noise
    ]
    header = ("channel", "unit", "noise", "stated", "ratio", "low-pass Hz", "resolution")
    stated = f"; stated: {found.stated}" if found.stated else ""
    title = f"Noise, standard deviation at {found.rate:g} Hz ({found.source}{stated})"
    print_blocks(Table(title, header, rows) if rows else "no channel shows noise", *found.warnings)
    if found.findings is not None:
        print_sensor_findings(found.findings)
        print_contradictions(found.contradictions)
    told = [(one.quantity, VERDICTS[one.verdict], one.why) for one in found.observable]
    print_blocks(Table("What these sensors can tell", ("quantity", "", "why"), told))


def print_contradictions(found: Sequence[str]) -> None:
    """Print a warning for every contradiction of redundant sensors, as `check` and `import` do."""
    print_blocks(*(f"warning: {words}" for words in found))


def campaign_entries(tests: Sequence[RecordSummary]) -> dict[str, Any]:
    """Duration, rate, channels and peak motions by test, for `--json`."""
    return {"summary": {one.test: {k: v for k, v in one._asdict().items() if k != "test"} for one in tests}}


def print_tests(tests: Sequence[RecordSummary]) -> None:
    """Print a line a test, with the peak motion of the axis that moves farthest."""
    wanted = [(q, AXES[:3], f"{q} [{unit}]") for q, unit in zip(QUANTITIES, ("m", "m/s", "m/s2"), strict=True)]
    wanted.append((QUANTITIES[0], AXES[3:], "rotation [rad]"))
    rows = []
    for one in tests:
        row = [one.test, f"{one.seconds:.1f}", f"{one.rate_hz:g}", str(one.channels)]
        for quantity, axes, _ in wanted:
            moved = {axis: peak for axis, peak in one.peaks.get(quantity, {}).items() if axis in axes and peak > 0}
            axis = max(moved, key=lambda name: moved[name], default="")
            row.append(f"{moved[axis]:.3g} {axis}" if axis else "")
        rows.append(row)
    header = ("test", "seconds", "Hz", "channels", *(f"peak {label}" for *_, label in wanted))
    cut = (f"{one.test} {one.cut}; record a real test to a rest after its motion" for one in tests if one.cut)
    print_blocks(Table("Tests, with the measured peaks of the platen's motion and their axes", header, rows), *cut)
