"""The report of a decomposed record: forces by inverse dynamics against measured ones (report, Section 6.1)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...core.names import AXES
from ...identification.decompose import Decomposed, Match, Work, WrenchAgreement, decompose_numbers
from ...identification.decompose.agreement import Explanation
from .control_blocks import load_of
from .decompose_plots import component_blocks, effect_blocks, force_scale, moved_axes, six_row_blocks, work_blocks
from .page import Headline, Level, Markup, Page, Section, bullet_list, number, paragraph, save_page, table, versions
from .run_motion import percent, shown_as

__all__ = ["write_decompose_report"]

EXACT = 1e-3  # share of the measured force below which a residual of a record without noise counts as small
SUFFICES: dict[Explanation, str] = {
    "none needed": "–",
    "noise": "noise",
    "sensors": "calibration of sensors",
    "parameters": "uncertain parameters",
    "nothing": "nothing known",
}
ORDER: Sequence[Explanation] = ("none needed", "noise", "sensors", "parameters", "nothing")


def write_decompose_report(
    found: Decomposed, agreement: WrenchAgreement, work: Work, path: Path | str, *, command: str = ""
) -> Path:
    """Write the self-contained HTML report of a decomposed record to `path` and return the path."""
    record, machine = found.record, found.plant.machine
    verdict, level = _judge(found, agreement)
    span = f"{number(float(found.time[-1] - found.time[0]))} s at {1 / found.dt:.6g} samples a second"
    page = Page(
        kind=f"Inverse dynamics · {record.attrs.get('kind', 'test')}",
        title=f"Forces behind {record.attrs.get('title') or record.attrs.get('test') or 'a test'}",
        asked=(
            f"Take the measured forces apart with the equations of {load_of(machine)}, {span}, compared up to "
            f"{number(found.comparison.band.high)} Hz."
        ),
        verdict=verdict,
        level=level,
        headlines=_headlines(found, agreement),
        sections=[
            Section("residual", "What is left", _residual_blocks(found, agreement)),
            Section("agreement", "Agreement by axis", _match_blocks(found, agreement)),
            Section("six-rows", "Modelled and measured forces", six_row_blocks(found)),
            Section("effects", "Forces by effect", effect_blocks(found, agreement)),
            Section("components", "Measured forces of the components", component_blocks(found)),
            Section("work", "Energy and power", [_work_table(work), *work_blocks(work, found.dt)]),
            Section("assumptions", "Assumptions and sources", _assumptions(found)),
        ],
        command=command or None,
        versions=versions(),
    )
    return save_page(page, path)


def _judge(found: Decomposed, agreement: WrenchAgreement) -> tuple[str, Level]:
    axes = found.plant.axes
    if found.sensors is None:
        left = np.abs(found.forces.residual).max(axis=0)[axes]
        share = float(np.max(left / np.maximum(np.abs(found.forces.measured).max(axis=0)[axes], 1.0)))
        words = "The record is free of noise. What the equations leave unexplained is"
        return (
            f"{words} {share:.1e} of the largest measured force of its axis, or less.",
            "good" if share < EXACT else "bad",
        )
    varying, offset = agreement.varying_explained, agreement.offset_explained
    by: dict[Explanation, list[str]] = {}
    for k in axes:
        by.setdefault(varying[k], []).append(AXES[k])
    said = {
        "noise": "at the noise's level",
        "sensors": "above the noise and within what calibration errors of the sensors allow",
        "parameters": "beyond noise and sensors and within the stated uncertainty of the parameters: calibrate",
        "nothing": "beyond what noise, sensors and parameters allow: an effect is missing, or a sensor is wrong",
    }
    words = "; ".join(f"in {', '.join(by[kind])} it is {said[kind]}" for kind in ORDER if kind in by)
    worst = max(axes, key=lambda k: agreement.noise_ratio[k] if np.isfinite(agreement.noise_ratio[k]) else 0.0)
    sentences = [
        f"What is left varies {number(float(agreement.noise_ratio[worst]))} times as much as noise alone would, at "
        f"worst ({AXES[worst]}): {words}."
    ]
    means = [k for k in axes if offset[k] in ("parameters", "nothing")]
    if means:
        sentences.append(f"Its mean in {', '.join(AXES[k] for k in means)} is more than offsets of sensors allow.")
    else:
        sentences.append("Its mean is within what offsets of the sensors allow in every axis.")
    order = max(ORDER.index(x[k]) for k in axes for x in (varying, offset))
    levels: dict[Explanation, Level] = {"parameters": "attention", "nothing": "bad"}
    return " ".join(sentences), levels.get(ORDER[order], "good")


def _headlines(found: Decomposed, agreement: WrenchAgreement) -> list[Headline]:
    moved = [AXES.index(a) for a in moved_axes(found)] or list(found.plant.axes)
    tiles = []
    for match, what in ((agreement.actuators, "total actuator force"), (agreement.dissipative, "dissipative force")):
        worst = max(moved, key=lambda k: float(match.rrmse_varying[k]))
        note = f"{AXES[worst]}; {percent(float(match.rrmse[worst]))} with the mean"
        tiles.append(Headline(percent(float(match.rrmse_varying[worst])), f"Worst RRMSE of the {what}, mean off", note))
    if found.sensors is not None:
        ratio = agreement.noise_ratio
        worst = max(found.plant.axes, key=lambda k: float(np.nan_to_num(ratio[k])))
        fits = all(agreement.varying_explained[k] == "noise" for k in found.plant.axes)
        note = f"{AXES[worst]}, of all axes; up to {number(1 + agreement.noise_range)} is noise that is known no better"
        level: Level = "good" if fits else "attention"
        tiles.append(Headline(number(float(ratio[worst])), "Residual over noise, at worst", note, level))
    return tiles


def _residual_blocks(found: Decomposed, agreement: WrenchAgreement) -> list[Markup]:
    if found.sensors is None:
        rows = []
        for k in found.plant.axes:
            scale = force_scale(AXES[k])
            most = float(np.abs(found.forces.residual[:, k]).max())
            largest = float(np.abs(found.forces.measured[:, k]).max())
            rows.append((AXES[k], shown_as(most, scale), shown_as(largest, scale)))
        return [table("Residual of a record without noise", ("Axis", "Largest residual", "Largest measured"), rows)]
    varying, means = [], []
    for k in found.plant.axes:
        scale = force_scale(AXES[k])
        levels = (agreement.residual, agreement.sensors, agreement.parameters)
        left, sensors, parameters = (shown_as(float(x.varying[k]), scale) for x in levels)
        ratio = number(float(agreement.noise_ratio[k]))
        noise = shown_as(float(agreement.noise[k]), scale)
        varying.append((AXES[k], left, noise, ratio, sensors, parameters, SUFFICES[agreement.varying_explained[k]]))
        left, sensors, parameters = (shown_as(float(x.offset[k]), scale) for x in levels)
        means.append((AXES[k], left, sensors, parameters, SUFFICES[agreement.offset_explained[k]]))
    coverage = number(agreement.coverage, 1)
    how = paragraph(
        "The residual is the required less the measured actuator wrench at C in {c}. Noise: another draw of the "
        "sensors' noise added to the record and taken apart once more. Sensors: one standard deviation of every gain "
        "and offset of the forces, of the skew between forces and motion and of the gain of each axis's motion. "
        "Parameters: one standard deviation of every number of the platen and of the kinds of components that states "
        "one; geometry is left out. Both are propagated linearly, one by one, and added in squares. What suffices: the "
        f"first of noise (and {percent(agreement.noise_range)} of it), sensors and parameters ({coverage} standard "
        "deviations) that reaches the residual."
    )
    header = ("Axis", "Residual", "Noise", "Ratio", "Sensors", "Parameters", "What suffices")
    return [
        how,
        table("Varying part: standard deviations over time", header, varying),
        table("Mean", ("Axis", "Residual", "Sensors", "Parameters", "What suffices"), means),
    ]


def _match_blocks(found: Decomposed, agreement: WrenchAgreement) -> list[Markup]:
    blocks = [
        paragraph(
            "RRMSE = √(Σ error² ∕ Σ measured²); with the mean off, of both. The delay is that of the modelled force "
            "behind the measured one, where their correlation is high enough for it to mean anything."
        )
    ]
    matches = (
        ("Total actuator force", agreement.actuators),
        ("Strut force", agreement.struts),
        ("Dissipative force", agreement.dissipative),
    )
    for what, match in matches:
        if match is None:
            blocks.append(paragraph(f"{what}: the record has no strut pressures to compare with."))
            continue
        header = ("Axis", "RRMSE", "RRMSE, mean off", "Peak ratio", "Correlation", "Delay")
        blocks.append(table(f"{what}, modelled against measured", header, [_row(match, k) for k in found.plant.axes]))
    return blocks


def _row(match: Match, k: int) -> tuple[str, ...]:
    late = f"{1e3 * match.delay[k]:.3f} ± {1e3 * match.delay_error[k]:.3f} ms" if np.isfinite(match.delay[k]) else "–"
    shares = percent(float(match.rrmse[k])), percent(float(match.rrmse_varying[k]))
    return AXES[k], *shares, number(float(match.peak_ratio[k])), f"{match.correlation[k]:.4f}", late.replace("-", "−")


def _work_table(work: Work) -> Markup:
    rows = [
        (
            name.replace("_", " "),
            f"{number(float(work.energy[-1, i]) / 1e3)} kJ",
            f"{number(float(np.abs(work.power[:, i]).max()) / 1e3)} kW",
        )
        for i, name in enumerate(work.effects)
    ]
    rows.append(("sum: work of inertia", f"{number(float(work.inertia[-1]) / 1e3)} kJ", ""))
    rows.append(("change of kinetic energy", f"{number(float(work.kinetic[-1]) / 1e3)} kJ", ""))
    rows.append(("largest difference of the two", f"{number(float(np.abs(work.unbalanced).max()) / 1e3)} kJ", ""))
    return table("Work on the platen over the whole test", ("Effect", "Energy", "Largest power"), rows)


def _assumptions(found: Decomposed) -> list[Markup]:
    machine = found.plant.machine
    doubt = sum(q.assumed for q in machine.parameters.values())
    said = [
        *found.notes,
        f"Everything compared went through one zero-phase low-pass, gain one half at {found.comparison.band.high:g} "
        f"Hz, order {found.comparison.band.order}; {found.comparison.edge:g} s at each end are left out. Friction was "
        "marched along the motion before that, starting at rest. Power and energy are of the unfiltered forces.",
        f"{doubt} of the {len(machine.parameters)} numbers of {machine.name} are assumed; “lhpost6 info” lists them.",
    ]
    rows = [
        (path, f"{float(np.max(q.value)):g}{f' {q.unit}' if q.unit != '1' else ''}", q.evidence, q.source)
        for path, q in decompose_numbers().items()
    ]
    if found.sensors is not None:
        assumed = sum(q.assumed for q in found.sensors.parameters.values())
        total = len(found.sensors.parameters)
        said.append(
            f"Noise and calibration ranges are those of “{found.sensors.name}”; {assumed} of {total} are assumed."
        )
        said.append(
            "Where the platen rests for seconds after a motion, noise of the displacement slowly shakes loose the "
            "friction that is marched along it; what then appears as unexplained is no effect. The noise to be "
            "expected is found in the same way and includes it."
        )
    caption = "Numbers used, where the command gives no other"
    return [bullet_list(said), table(caption, ("Number", "Value", "Evidence", "Source"), rows)]
