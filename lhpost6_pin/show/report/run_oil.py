"""Section of a run report on the oil that the valves draw from pumps and accumulators."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from ...data.metrics import channel, sampling
from ...simulation.oil_use import Bank, oil_use
from .page import Block, Table, missing, number
from .plots import ACHIEVED, Row, Trace
from .run_components import draw_over_time
from .scales import SCALES, Scale, percent

__all__ = ["oil_blocks"]

FLOW = Scale(6e4, "l/min")
VOLUME = Scale(1e3, "l")
PRESSURE = SCALES["pressure"]


def oil_blocks(record: xr.Dataset) -> list[Block]:
    """Return the flow drawn by all valves over time, and its use of pumps and accumulators where they are known."""
    if "supply_flow" not in record:
        return [missing(["supply_flow"], "The oil drawn from the supply is not shown.")]
    flow, step = channel(record, "supply_flow"), sampling(record)[1]
    known = record["supply_flow"].attrs
    pumps, bank = float(known.get("pump_flow", np.nan)), _bank(known)
    use = oil_use(flow, step, pumps)
    rows = [
        ("peak flow", FLOW.unit, number(use.peak * FLOW.factor)),
        ("mean flow", FLOW.unit, number(use.mean * FLOW.factor)),
        ("volume drawn", VOLUME.unit, number(use.volume * VOLUME.factor)),
    ]
    if np.isfinite(pumps):
        rows.append((f"flow of the pumps{_assumed(known, 'pump_flow')}", FLOW.unit, number(pumps * FLOW.factor)))
        taken = use.from_accumulators
        rows.append(("largest volume drawn from the accumulators", VOLUME.unit, number(taken * VOLUME.factor)))
        if bank is not None:
            rows += _bank_rows(bank, taken, known)
    words = "Flow that all valves draw from the supply."
    if "supply_pressure" in record and np.ptp(channel(record, "supply_pressure")) == 0.0:
        words = f"{words[:-1]}, whose pressure the model takes as constant."
    lines = {"pumps": pumps} if np.isfinite(pumps) else {}
    row = Row("Flow", [Trace("drawn by all valves", flow, ACHIEVED)], FLOW, lines)
    table = Table("Oil drawn, pumps and accumulators", ("Quantity", "Unit", "Value"), rows)
    return [draw_over_time(record, "oil", "Oil drawn over time", words, [row]), table]


def _bank(known: Mapping[str, Any]) -> Bank | None:
    """The accumulators that a record states in full."""
    names = ("accumulators", "precharge", "charged", "lowest", "gas_index")
    return Bank(*(float(known[name]) for name in names)) if all(name in known for name in names) else None


def _bank_rows(bank: Bank, taken: float, known: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Use of the accumulators: of the oil that they give above the lowest pressure, and what pressure is left."""
    span = f"{number(bank.charged * PRESSURE.factor)} to {number(bank.lowest * PRESSURE.factor)} {PRESSURE.unit}"
    usable = f"usable volume of the accumulators, {span}{_assumed(known, 'lowest')}"
    left = bank.pressure_after(taken)
    return [
        (usable, VOLUME.unit, number(bank.usable * VOLUME.factor)),
        ("share of it that is drawn", "", percent(taken / bank.usable)),
        ("lowest pressure of their gas", PRESSURE.unit, number(left * PRESSURE.factor)),
    ]


def _assumed(known: Mapping[str, Any], name: str) -> str:
    return " (assumed)" if known.get(f"{name}_evidence") == "assumed" else ""
