"""First section of a decomposition: the wrench of the specimen on the platen, with its interval."""

import numpy as np

from ...core.arrays import Array
from ...identification.decompose.interface import InterfacePeak, InterfaceWrench
from ...mechanics.interface_wrench import INTERFACE_AXES
from .page import Block, Headline, Table
from .plots import BLACK, BLUE, ORANGE, SKY, VERMILLION, Row, Trace, time_figure
from .scales import Scale, scaled_number, shown_as
from .specimen_section import FORCE, INTERFACE_NAMES, MOMENT

__all__ = ["interface_blocks", "interface_headlines", "interface_sentence", "interface_table"]

BUCKETS = 900  # stretches of a channel over time, each drawn by its least and greatest sample
MEASURED = {"color": BLUE, "width": 1.3}
BOUND = {"color": SKY, "width": 0.8}
PREDICTED = {"color": VERMILLION, "width": 1.1, "dash": "dash"}
FLOORS = {"color": ORANGE, "width": 1.1, "dash": "dot"}
SIMULATED = {"color": BLACK, "width": 1.0, "dash": "dot"}


def _scale(component: str) -> Scale:
    return FORCE if component.startswith("f") else MOMENT


def _share(found: InterfaceWrench) -> str:
    return f"{100.0 * found.confidence:.0f}\N{NO-BREAK SPACE}%"


def interface_table(found: InterfaceWrench) -> Table:
    """Return the peaks of all components with times and intervals, beside those of the mounted model."""
    known = found.sd.any()
    rows = []
    for peak in found.peaks:
        scale = _scale(peak.component)
        shown = [INTERFACE_NAMES[peak.component], scale.unit, scaled_number(peak.value, scale)]
        shown += [f"± {scaled_number(peak.half_width, scale)}"] * bool(known)
        shown += [f"{peak.time:.3f} s"]
        shown += [scaled_number(peak.predicted, scale)] * (found.predicted is not None)
        for values in (found.floors, found.simulated):
            if values is not None:
                column = values[:, INTERFACE_AXES.index(peak.component)]
                shown.append(scaled_number(float(column[np.argmax(np.abs(column))]), scale))
        rows.append(shown)
    header = ["Component", "Unit", "Peak", *[f"{_share(found)} interval"] * bool(known), "Time"]
    header += ["Mounted model"] * (found.predicted is not None) + ["Floors"] * (found.floors is not None)
    header += ["Simulated"] * (found.simulated is not None)
    at = ", ".join(f"{x:g}" for x in found.place)
    return Table(f"Wrench of the specimen on the platen at the interface ({at} m from C), platen axes", header, rows)


def interface_blocks(found: InterfaceWrench, step: float) -> list[Block]:
    """Return the picture and the table of the interface wrench, where its intervals come from."""
    curves = [("from measured forces", found.wrench, MEASURED)]
    if found.sd.any():
        width = found.half_width
        curves[:0] = [(f"{_share(found)} interval", found.wrench - width, BOUND)]
        curves[1:1] = [("", found.wrench + width, BOUND)]
    named = ("mounted model", found.predicted, PREDICTED), ("floors' masses times accelerations", found.floors, FLOORS)
    curves += [(name, x, line) for name, x, line in named if x is not None]
    if found.simulated is not None:
        curves.append(("simulated", found.simulated, SIMULATED))
    rows = [
        Row(INTERFACE_NAMES[name].capitalize(), _traces(curves, j), _scale(name))
        for j, name in enumerate(INTERFACE_AXES)
    ]
    words = (
        "Required by the motion of the bare table, less measured actuator forces, struts, weight and friction; of the "
        "specimen on the platen, its weight included. No motion of the specimen is needed."
    )
    title = "What the specimen exerted on the platen"
    drawn = time_figure(
        "interface", title, words, rows, start=float(found.time[0]), step=step, buckets=BUCKETS, row_height=150
    )
    return [interface_table(found), drawn, *_sources(found)]


def interface_headlines(found: InterfaceWrench) -> list[Headline]:
    """Return tiles of base shear, overturning moment and axial force."""
    by_name = {peak.component: peak for peak in found.peaks}
    tiles = []
    for label, names in (("base shear", ("fx", "fy")), ("overturning moment", ("mx", "my")), ("axial force", ("fz",))):
        peak = max((by_name[name] for name in names), key=lambda one: abs(one.value))
        note = f"{INTERFACE_NAMES[peak.component]}, at {peak.time:.2f} s"
        if found.sd.any():
            note += f"; ± {shown_as(peak.half_width, _scale(peak.component))} at {_share(found)}"
            note += "" if peak.shown else ", not distinguished from zero"
        tiles.append(Headline(shown_as(abs(peak.value), _scale(peak.component)), f"Peak {label}", note))
    return tiles


def interface_sentence(found: InterfaceWrench) -> str:
    """Return the peaks of base shear, overturning moment and axial force in a sentence."""

    def said(peak: InterfacePeak) -> str:
        scale = _scale(peak.component)
        width = f" ± {scaled_number(peak.half_width, scale)}" if found.sd.any() else ""
        doubt = "" if peak.shown else " (not distinguished from zero)"
        return f"{INTERFACE_NAMES[peak.component]} {scaled_number(abs(peak.value), scale)}{width} {scale.unit}{doubt}"

    return f"Peaks at the interface of the specimen: {', '.join(said(peak) for peak in found.peaks[:5])}."


def _traces(curves: list[tuple[str, Array, dict[str, object]]], j: int) -> list[Trace]:
    return [Trace(name or "", x[:, j], line) for name, x, line in curves]


def _sources(found: InterfaceWrench) -> list[Block]:
    if not found.sd.any():
        return ["Without noise in the record there is no interval."]
    rms = [np.sqrt(np.mean(np.broadcast_to(x, found.wrench.shape) ** 2, axis=0)) for x in
           (found.noise, found.sensors, found.parameters, found.sd)]  # fmt: skip
    rows = [
        (INTERFACE_NAMES[name], _scale(name).unit, *(scaled_number(float(x[j]), _scale(name)) for x in rms))
        for j, name in enumerate(INTERFACE_AXES)
    ]
    header = ("Component", "Unit", "Noise", "Sensors' calibration", "Bare table's parameters", "All")
    of = f"{found.stated} parameters of the bare table have the standard deviation that the machine file states"
    if found.calibrated:
        of = f"{found.calibrated} parameters have that of a calibration or override, {found.stated} the machine file's"
    return [
        Table("Standard deviations over time, RMS", header, rows),
        "Interval: normal, at each instant; that of a peak holds for all instants at once, since noise raises the "
        "largest of many samples. Noise by a second draw; gains, offsets and skews of sensors and parameters "
        f"of the bare table one by one, added in squares as independent. {of}; a calibration of the bare table "
        "(“lhpost6 calibrate”, its file for --override) narrows them. Parameters without a stated deviation, and "
        "geometry, are taken as exact.",
    ]
