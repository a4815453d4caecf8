"""Tables of `lhpost6 check` for a campaign: noise, disagreement of redundant sensors, what sensors can tell."""

import math
from typing import Any

from ..data.campaign_check import CampaignCheck
from .report.page import Table
from .tables import print_sensor_findings
from .terminal import print_blocks

__all__ = ["check_entries", "print_check"]

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
    told = [(one.quantity, VERDICTS[one.verdict], one.why) for one in found.observable]
    print_blocks(Table("What these sensors can tell", ("quantity", "", "why"), told))
