"""How far the effects of a case reach, in units of the sensors' noise: the abscissa of the strength curve.

Two measures of each effect on the held-out tests, and the largest figure of each over its channels:
`gap`, `offset`: the closed loop run again without the effect; root mean square change about the mean, change of a mean;
`own`: what the effect itself adds at the states passed through: to the platen's acceleration, to the rates of the
chambers' pressures (over the rate of their noise), to lengths, gas and supply pressure; root mean square.
The loop hides slow changes of force and shows the least leak as a changed level of pressure; `own` does neither.
"""

import numpy as np

from .cases import Case, numbers
from .generate import Run, machine, run_test
from .rates import GAS, GAS_PRESSURE, PA, SHOWN, STATES, SUPPLY, SUPPLY_PRESSURE, TWIST, X, rates
from .sensors import COMPUTED, floor_of, low_pass
from .simulate import RATE
from .table import mass_matrix

__all__ = ["measured_label"]

STRIDE = 4  # control samples from one look to the next: the records' rate


def measured_label(case: Case) -> dict:
    """The case's label with `gap`, `offset`, `own` of each effect and, by channel, `gaps`, `offsets`, `owns`."""
    tests = [test for test in case.tests if test.name in case.hold_out]
    with_all = [run_test(case, test) for test in tests] if case.effects else []
    part = "effects" if case.label["effects"] else "decoys"
    described = []
    for i, entry in enumerate(case.label[part]):
        rest = case.effects[:i] + case.effects[i + 1 :]
        each = [
            (
                *_changes(*(_seen(case, one) for one in (run, run_test(case, test, rest)))),
                _own(run, *machine(case, test, rest)),
            )
            for run, test in zip(with_all, tests, strict=True)
        ]
        worst = [
            {name: max(one[name] for one in measure) for name in measure[0]} for measure in zip(*each, strict=True)
        ]
        figures = {"gap": worst[0], "offset": worst[1], "own": worst[2]}
        largest = {name: max(values.values()) for name, values in figures.items()}
        described.append({**entry, **largest, **{f"{name}s": values for name, values in figures.items()}})
    return {**case.label, part: described}


def _seen(case: Case, run: Run) -> dict[str, np.ndarray]:
    """What is recorded of a run, without noise."""
    return {name: values for name, values in run.truth().items() if name not in case.left_out}


def _changes(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> tuple[dict[str, float], dict[str, float]]:
    """Root mean square about the mean, and mean, of a difference over the noise, by variable."""
    rule = numbers()["sensors"]
    moving, still = {}, {}
    for name in (name for name in a if name not in COMPUTED):
        change, floor = low_pass(a[name] - b[name], rule), floor_of(name, rule)
        moving[name] = float((change.std(axis=0) / floor).max())
        still[name] = float((np.abs(change.mean(axis=0)) / floor).max())
    return moving, still


def _own(run: Run, legs: np.ndarray, platen: np.ndarray) -> dict[str, float]:
    """What the effect adds at the states of a run, whose legs and platen without it are given."""
    rule = numbers()["sensors"]
    channels = run.channels
    plain = channels.spool.copy()
    late = np.round((run.legs["late"] - legs["late"] + 2 * (run.legs["lag"] - legs["lag"]))[:10] * RATE, 3)
    behind = np.arange(len(plain)) - round(float(legs["valve_delay"][0]) * RATE)
    for i in np.flatnonzero(late):  # without its lag the spool would be where it was sent a valve's delay ago
        plain[:, i] = channels.command[np.maximum(behind, 0), i]
    added = _added(
        *(channels.state[::STRIDE], channels.spool[::STRIDE], plain[::STRIDE], run.surge[::STRIDE], STRIDE / RATE),
        *(run.legs, run.platen, np.linalg.inv(mass_matrix(run.platen))),
        *(legs, platen, np.linalg.inv(mass_matrix(platen))),
    )
    rms = np.sqrt(np.mean(added**2, axis=0))
    floors = {
        "acceleration": (slice(0, 6), floor_of("platen_acceleration", rule)),
        "pressure_rate": (slice(6, 20), rule["pressure_rate_floor"]),
        "length": (slice(20, 30), floor_of("actuator_displacement", rule)),
        "gas": (slice(30, 33), floor_of("strut_pressure", rule)),
        "supply": (slice(33, 34), floor_of("supply_pressure", rule)),
    }
    return {name: float((rms[columns] / floor).max()) for name, (columns, floor) in floors.items()}


def _added(states, spools, plain, surge, step, legs, platen, inverse, legs_0, platen_0, inverse_0):
    """Accelerations (6), pressure rates (14), extensions (10), gas (3) and supply (1): with less without (n, 34)."""
    n = len(states)
    out, y = np.empty((n, 34)), np.empty(STATES)
    dy, dy_0, shown, shown_0 = np.zeros(STATES), np.zeros(STATES), np.zeros(SHOWN), np.zeros(SHOWN)
    for k in range(n):
        rates(k * step, states[k], spools[k], surge[k], legs, platen, inverse, dy, shown)
        y[:] = states[k]  # states of what is not there are at rest
        y[GAS : GAS + 3] *= legs_0["gas_rate"][10:] != 0.0
        y[SUPPLY] *= platen_0["droop"][0] != 0.0
        calm = surge[k] * (platen_0["surge"][0] != 0.0)
        rates(k * step, y, plain[k], calm, legs_0, platen_0, inverse_0, dy_0, shown_0)
        out[k, :6] = dy[TWIST : TWIST + 6] - dy_0[TWIST : TWIST + 6]
        out[k, 6:20] = dy[PA : PA + 14] - dy_0[PA : PA + 14]
        out[k, 20:30] = shown[X : X + 10] - shown_0[X : X + 10]
        out[k, 30:33] = shown[GAS_PRESSURE : GAS_PRESSURE + 3] - shown_0[GAS_PRESSURE : GAS_PRESSURE + 3]
        out[k, 33] = shown[SUPPLY_PRESSURE] - shown_0[SUPPLY_PRESSURE]
    return out
