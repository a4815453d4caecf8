"""The report of a force decomposition: inverse dynamics against measured forces (report, Section 6.1)."""

from pathlib import Path

import numpy as np

from ...core.names import AXES
from ...identification.decompose import Decomposed, Match, Work, WrenchAgreement, decompose_numbers
from ...identification.decompose.agreement import Explanation
from .control_blocks import DEFAULTS, assumed_in, load_of, numbers_used
from .decompose_plots import component_figure, effect_blocks, moved_axes, six_row_blocks, work_figure
from .interface_section import interface_blocks, interface_headlines, interface_sentence
from .page import Block, Headline, Level, Page, Section, Table, bullet_list, number, save_page
from .scales import force_scale, percent, shown_as

__all__ = ["match_tables", "residual_tables", "write_decompose_report"]

LOADED = 1e-3  # of the largest force of its kind, up to which an axis bears none and is not judged without noise
EXACT = 1e-3  # fraction of the measured force below which the residual of a noise-free record counts as small
MATCH = (
    "RRMSE = √(Σ error² ∕ Σ measured²); mean removed: from both. Delay: of the modelled behind the measured force "
    "(negative: ahead of it), given where their correlation is high enough to determine it. At rest: an axis whose "
    "measured force is rounding beside the largest; the difference is given in its unit."
)
EXPLANATIONS: dict[Explanation, tuple[str, str]] = {  # sufficient explanation, and the residual by it
    "none needed": ("–", ""),
    "noise": ("noise", "at noise level"),
    "sensors": ("calibration of sensors", "above noise and within the calibration uncertainty of the sensors"),
    "parameters": (
        "uncertain parameters",
        "beyond noise and sensor uncertainty but within that of the parameters: calibrate",
    ),
    "nothing": (
        "none known",
        "beyond noise, sensor and parameter uncertainty: an effect is missing, or a sensor is wrong",
    ),
}


def write_decompose_report(
    found: Decomposed, agreement: WrenchAgreement, work: Work, path: Path | str, *, command: str = ""
) -> Path:
    """Write the self-contained HTML report of a decomposed record to `path` and return the path."""
    record, machine, interface = found.record, found.mounted.machine, agreement.interface
    verdict, level = _verdict(found, agreement)
    first = []
    if interface is not None:
        verdict = f"{interface_sentence(interface)} {verdict}"
        first.append(Section("interface", "Specimen: interface wrench", interface_blocks(interface, found.dt)))
    span = f"{number(float(found.time[-1] - found.time[0]))} s at {1 / found.dt:.6g} samples a second"
    page = Page(
        kind=f"Inverse dynamics · {record.attrs.get('kind', 'test')}",
        title=f"Forces behind {record.attrs.get('title') or record.attrs.get('test') or 'a test'}",
        purpose=(
            f"Decompose the measured forces with the equations of {load_of(machine)}, {span}, compared up to "
            f"{number(found.comparison.band.high)} Hz."
        ),
        verdict=verdict,
        level=level,
        headlines=_headlines(found, agreement),
        sections=[
            *first,
            Section("effects", "Forces by effect", effect_blocks(found, agreement)),
            Section("residual", "Residual", _residual_blocks(found, agreement)),
            Section("agreement", "Agreement by axis", [MATCH, *match_tables(found, agreement)]),
            Section("six-rows", "Modelled and measured forces", six_row_blocks(found)),
            Section("components", "Measured forces of the components", [component_figure(found)]),
            Section("work", "Energy and power", [_work_table(work), work_figure(found, work)]),
            Section("assumptions", "Assumptions and sources", _assumptions(found)),
        ],
        command=command,
    )
    return save_page(page, path)


def _verdict(found: Decomposed, agreement: WrenchAgreement) -> tuple[str, Level]:
    axes = found.plant.axes
    if found.sensors is None:
        residual, measured = (np.abs(x).max(axis=0) for x in (found.forces.residual, found.forces.measured))
        most = np.repeat([measured[:3].max(), measured[3:].max()], 3)
        judged = [k for k in axes if measured[k] > max(LOADED * most[k], 1.0)]
        if not judged:
            return "Noise-free record without forces: there is nothing to compare.", "attention"
        share = max(float(residual[k] / measured[k]) for k in judged)
        named = "" if len(judged) == len(axes) else f" ({', '.join(AXES[k] for k in judged)}; the others bear none)"
        what = f"the residual is at most {share:.1e} of the largest measured force of its axis{named}"
        return f"Noise-free record: {what}.", "good" if share < EXACT else "bad"
    varying, offset = agreement.varying_explained, agreement.offset_explained
    by = {kind: ", ".join(AXES[k] for k in axes if varying[k] == kind) for kind in EXPLANATIONS}
    words = "; ".join(f"in {names} {EXPLANATIONS[kind][1]}" for kind, names in by.items() if names)
    worst = max(axes, key=lambda k: agreement.noise_ratio[k] if np.isfinite(agreement.noise_ratio[k]) else 0.0)
    means = [AXES[k] for k in axes if offset[k] in ("parameters", "nothing")]
    sentences = [
        f"The residual is at most {number(float(agreement.noise_ratio[worst]))} times the expected noise "
        f"({AXES[worst]}): {words}.",
        f"Its mean in {', '.join(means)} exceeds the offset uncertainty of the sensors."
        if means
        else "Its mean is within the offset uncertainty of the sensors in every axis.",
    ]
    needed = {x[k] for k in axes for x in (varying, offset)}
    level: Level = "bad" if "nothing" in needed else "attention" if "parameters" in needed else "good"
    return " ".join(sentences), level


def _headlines(found: Decomposed, agreement: WrenchAgreement) -> list[Headline]:
    moved = [AXES.index(a) for a in moved_axes(found)] or list(found.plant.axes)
    tiles = [] if agreement.interface is None else interface_headlines(agreement.interface)
    for match, what in ((agreement.actuators, "total actuator force"), (agreement.dissipative, "dissipative force")):
        worst = max(moved, key=lambda k: float(np.nan_to_num(match.rrmse_varying[k])))
        note = f"{AXES[worst]}; {percent(float(match.rrmse[worst]))} including the mean"
        if len(moved) < len(found.plant.axes):
            note += f"; of the axes that move ({', '.join(AXES[k] for k in moved)}), not those almost at rest"
        label = f"Worst RRMSE of the {what}, mean removed"
        tiles.append(Headline(percent(float(match.rrmse_varying[worst])), label, note))
    if found.sensors is not None:
        ratio = agreement.noise_ratio
        worst = max(found.plant.axes, key=lambda k: float(np.nan_to_num(ratio[k])))
        fits = all(agreement.varying_explained[k] == "noise" for k in found.plant.axes)
        note = f"{AXES[worst]}; up to {number(1 + agreement.noise_range)} is within the uncertainty of the noise"
        level: Level = "good" if fits else "attention"
        tiles.append(Headline(number(float(ratio[worst])), "Largest residual over noise", note, level))
    return tiles


def residual_tables(found: Decomposed, agreement: WrenchAgreement) -> list[Table]:
    """Return the residual of every axis with its expected size, varying part and mean; without noise its largest."""
    if found.sensors is None:
        both = found.forces.residual, found.forces.measured
        rows = [
            (AXES[k], *(shown_as(float(np.abs(x[:, k]).max()), force_scale(AXES[k])) for x in both))
            for k in found.plant.axes
        ]
        return [Table("Residual of a record without noise", ("Axis", "Largest residual", "Largest measured"), rows)]
    varying, means = [], []
    levels = agreement.residual, agreement.sensors, agreement.parameters
    for k in found.plant.axes:
        scale, ratio = force_scale(AXES[k]), number(float(agreement.noise_ratio[k]))
        noise = shown_as(float(agreement.noise[k]), scale)
        residual, *expected = (shown_as(float(x.varying[k]), scale) for x in levels)
        by, mean_by = (EXPLANATIONS[x[k]][0] for x in (agreement.varying_explained, agreement.offset_explained))
        varying.append((AXES[k], residual, noise, ratio, *expected, by))
        means.append((AXES[k], *(shown_as(float(x.offset[k]), scale) for x in levels), mean_by))
    tail, within = ("Sensors", "Parameters", "Sufficient explanation"), f"{number(agreement.coverage, 1)} of them"
    return [
        Table(
            f"Varying part of the residual: standard deviations over time (sufficient: within {within})",
            ("Axis", "Residual", "Noise", "Ratio", *tail),
            varying,
        ),
        Table(
            f"Mean of the residual: one standard deviation of each (sufficient: within {within})",
            ("Axis", "Residual", *tail),
            means,
        ),
    ]


def _residual_blocks(found: Decomposed, agreement: WrenchAgreement) -> list[Block]:
    tables = residual_tables(found, agreement)
    if found.sensors is None:
        return [*tables]
    how = (
        "The residual is the required less the measured actuator wrench at the centre of the platen's top (C), platen "
        "axes. Noise: a further draw of sensor noise added to the record and decomposed again. Sensors: one standard "
        "deviation of every gain and offset of the forces, of the skew between forces and motion and of the gain of "
        "each axis's motion. Parameters: one standard deviation of every number of the platen and of the kinds of "
        "components that states one; geometry is omitted. Both are propagated linearly, one by one, and added in "
        f"squares. Sufficient explanation: the first of noise (and {percent(agreement.noise_range)} of it), sensors "
        f"and parameters ({number(agreement.coverage, 1)} standard deviations) that covers the residual."
    )
    return [how, *tables]


def match_tables(found: Decomposed, agreement: WrenchAgreement) -> list[Block]:
    """Return the agreement of modelled with measured forces, axis by axis."""
    blocks: list[Block] = []
    header = ("Axis", "RRMSE", "RRMSE, mean removed", "Peak ratio", "Correlation", "Delay")
    matches = {"Total actuator": agreement.actuators, "Strut": agreement.struts, "Dissipative": agreement.dissipative}
    for what, match in matches.items():
        if match is None:
            blocks.append(f"{what} force: the record has no strut pressures to compare with.")
        else:
            rows = [_match_row(match, k) for k in found.plant.axes]
            blocks.append(Table(f"{what} force, modelled against measured", header, rows))
    return blocks


def _match_row(match: Match, k: int) -> tuple[str, ...]:
    if match.at_rest[k]:
        return (
            AXES[k],
            "at rest",
            f"differs by {shown_as(float(match.difference[k]), force_scale(AXES[k]))} rms",
            *"–––",
        )
    late = f"{1e3 * match.delay[k]:.3f} ± {1e3 * match.delay_error[k]:.3f} ms" if np.isfinite(match.delay[k]) else "–"
    shares = percent(float(match.rrmse[k])), percent(float(match.rrmse_varying[k]))
    return AXES[k], *shares, number(float(match.peak_ratio[k])), f"{match.correlation[k]:.4f}", late.replace("-", "−")


def _work_table(work: Work) -> Table:
    def shown(value: float, unit: str = "kJ") -> str:
        return f"{number(float(value) / 1e3)} {unit}"

    power = np.abs(work.power).max(axis=0)
    rows = [
        (name.replace("_", " "), shown(work.energy[-1, i]), shown(power[i], "kW"))
        for i, name in enumerate(work.effects)
    ]
    rows.append(("sum: work of inertia", shown(work.inertia[-1]), ""))
    rows.append(("change of kinetic energy", shown(work.kinetic[-1]), ""))
    rows.append(("largest imbalance", shown(np.abs(work.unbalanced).max()), ""))
    return Table("Work on the platen over the whole test", ("Effect", "Energy", "Largest power"), rows)


def _assumptions(found: Decomposed) -> list[Block]:
    band = found.comparison.band
    lines = [
        *found.notes,
        *filter(None, [found.slip]),
        f"All compared signals are low-passed by one zero-phase filter (gain 1/2 at {band.high:g} Hz, order "
        f"{band.order}); {found.comparison.edge:g} s at each end are omitted. Friction states are integrated along the "
        "unfiltered motion, from zero unless seals or pads hold a force at the start. Power and energy are those of "
        "the unfiltered forces.",
        assumed_in(found.plant.machine),
    ]
    if found.sensors is not None:
        assumed, total = sum(q.assumed for q in found.sensors.parameters.values()), len(found.sensors.parameters)
        lines += [
            f"Noise and calibration ranges: “{found.sensors.name}”; {assumed} of {total} numbers are assumed.",
            "While the platen rests after a motion, displacement noise slowly relaxes the friction states integrated "
            "along it; the resulting residual is not a missing effect. The expected noise is computed in the same way "
            "and includes it.",
        ]
    return [bullet_list(lines), numbers_used(decompose_numbers(), DEFAULTS)]
