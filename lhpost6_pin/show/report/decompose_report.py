"""The report of a force decomposition: inverse dynamics against measured forces (report, Section 6.1)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...core.names import AXES
from ...identification.decompose import Decomposed, Match, Work, WrenchAgreement, decompose_numbers
from ...identification.decompose.agreement import Explanation
from .control_blocks import DEFAULTS, assumed_in, load_of, numbers_used
from .decompose_plots import component_blocks, effect_blocks, force_scale, moved_axes, six_row_blocks, work_blocks
from .page import Headline, Level, Markup, Page, Section, bullet_list, number, paragraph, save_page, table
from .run_motion import percent, shown_as

__all__ = ["write_decompose_report"]

EXACT = 1e-3  # fraction of the measured force below which the residual of a noise-free record counts as small
SUFFICES: dict[Explanation, str] = {
    "none needed": "–",
    "noise": "noise",
    "sensors": "calibration of sensors",
    "parameters": "uncertain parameters",
    "nothing": "none known",
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
            f"Decompose the measured forces with the equations of {load_of(machine)}, {span}, compared up to "
            f"{number(found.comparison.band.high)} Hz."
        ),
        verdict=verdict,
        level=level,
        headlines=_headlines(found, agreement),
        sections=[
            Section("residual", "Residual", _residual_blocks(found, agreement)),
            Section("agreement", "Agreement by axis", _match_blocks(found, agreement)),
            Section("six-rows", "Modelled and measured forces", six_row_blocks(found)),
            Section("effects", "Forces by effect", effect_blocks(found, agreement)),
            Section("components", "Measured forces of the components", component_blocks(found)),
            Section("work", "Energy and power", [_work_table(work), *work_blocks(work, found.dt)]),
            Section("assumptions", "Assumptions and sources", _assumptions(found)),
        ],
        command=command,
    )
    return save_page(page, path)


def _judge(found: Decomposed, agreement: WrenchAgreement) -> tuple[str, Level]:
    axes = found.plant.axes
    if found.sensors is None:
        left = np.abs(found.forces.residual).max(axis=0)[axes]
        share = float(np.max(left / np.maximum(np.abs(found.forces.measured).max(axis=0)[axes], 1.0)))
        words = f"Noise-free record: the residual is at most {share:.1e} of the largest measured force of its axis."
        return words, "good" if share < EXACT else "bad"
    varying, offset = agreement.varying_explained, agreement.offset_explained
    by: dict[Explanation, list[str]] = {}
    for k in axes:
        by.setdefault(varying[k], []).append(AXES[k])
    said = {
        "noise": "at noise level",
        "sensors": "above noise and within the calibration uncertainty of the sensors",
        "parameters": "beyond noise and sensor uncertainty but within that of the parameters: calibrate",
        "nothing": "beyond noise, sensor and parameter uncertainty: an effect is missing, or a sensor is wrong",
    }
    words = "; ".join(f"in {', '.join(by[kind])} {said[kind]}" for kind in ORDER if kind in by)
    worst = max(axes, key=lambda k: agreement.noise_ratio[k] if np.isfinite(agreement.noise_ratio[k]) else 0.0)
    sentences = [
        f"The residual is at most {number(float(agreement.noise_ratio[worst]))} times the expected noise "
        f"({AXES[worst]}): {words}."
    ]
    means = [k for k in axes if offset[k] in ("parameters", "nothing")]
    if means:
        sentences.append(
            f"Its mean in {', '.join(AXES[k] for k in means)} exceeds the offset uncertainty of the sensors."
        )
    else:
        sentences.append("Its mean is within the offset uncertainty of the sensors in every axis.")
    order = max(ORDER.index(x[k]) for k in axes for x in (varying, offset))
    levels: dict[Explanation, Level] = {"parameters": "attention", "nothing": "bad"}
    return " ".join(sentences), levels.get(ORDER[order], "good")


def _headlines(found: Decomposed, agreement: WrenchAgreement) -> list[Headline]:
    moved = [AXES.index(a) for a in moved_axes(found)] or list(found.plant.axes)
    tiles = []
    for match, what in ((agreement.actuators, "total actuator force"), (agreement.dissipative, "dissipative force")):
        worst = max(moved, key=lambda k: float(match.rrmse_varying[k]))
        note = f"{AXES[worst]}; {percent(float(match.rrmse[worst]))} including the mean"
        tiles.append(
            Headline(percent(float(match.rrmse_varying[worst])), f"Worst RRMSE of the {what}, mean removed", note)
        )
    if found.sensors is not None:
        ratio = agreement.noise_ratio
        worst = max(found.plant.axes, key=lambda k: float(np.nan_to_num(ratio[k])))
        fits = all(agreement.varying_explained[k] == "noise" for k in found.plant.axes)
        note = f"{AXES[worst]}; up to {number(1 + agreement.noise_range)} is within the uncertainty of the noise"
        level: Level = "good" if fits else "attention"
        tiles.append(Headline(number(float(ratio[worst])), "Largest residual over noise", note, level))
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
        "The residual is the required less the measured actuator wrench at the centre of the platen's top (C), platen "
        "axes. Noise: a further draw of sensor noise added to the record and decomposed again. Sensors: one standard "
        "deviation of every gain and offset of the forces, of the skew between forces and motion and of the gain of "
        "each axis's motion. Parameters: one standard deviation of every number of the platen and of the kinds of "
        "components that states one; geometry is left out. Both are propagated linearly, one by one, and added in "
        f"squares. Sufficient explanation: the first of noise (and {percent(agreement.noise_range)} of it), sensors "
        f"and parameters ({coverage} standard deviations) that covers the residual."
    )
    header = ("Axis", "Residual", "Noise", "Ratio", "Sensors", "Parameters", "Sufficient explanation")
    return [
        how,
        table("Varying part: standard deviations over time", header, varying),
        table("Mean", ("Axis", "Residual", "Sensors", "Parameters", "Sufficient explanation"), means),
    ]


def _match_blocks(found: Decomposed, agreement: WrenchAgreement) -> list[Markup]:
    blocks = [
        paragraph(
            "RRMSE = √(Σ error² ∕ Σ measured²); mean removed: from both. Delay: of the modelled behind the measured "
            "force, given where their correlation is high enough to determine it."
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
        header = ("Axis", "RRMSE", "RRMSE, mean removed", "Peak ratio", "Correlation", "Delay")
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
    rows.append(("largest imbalance", f"{number(float(np.abs(work.unbalanced).max()) / 1e3)} kJ", ""))
    return table("Work on the platen over the whole test", ("Effect", "Energy", "Largest power"), rows)


def _assumptions(found: Decomposed) -> list[Markup]:
    band = found.comparison.band
    lines = [
        *found.notes,
        f"All compared signals are low-passed by one zero-phase filter (gain 1/2 at {band.high:g} Hz, order "
        f"{band.order}); {found.comparison.edge:g} s at each end are omitted. Friction states are integrated along the "
        "unfiltered motion, from rest. Power and energy are those of the unfiltered forces.",
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
