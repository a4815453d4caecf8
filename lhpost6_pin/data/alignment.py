"""Delays between groups of channels, from redundant channels, and their removal.

Only identities and kinematics are used, nothing that has dynamics of its own between the two:

    platen displacement   against  platen velocity, platen acceleration (its derivatives)
    platen displacement   against  actuator displacement (kinematics), strut pressure (kinematics and the gas law)
    actuator force        against  chamber pressures (P_A A_1 - P_B A_2)

so delays come in two chains, motion and force. What joins them, forces and accelerations, is inverse dynamics; what
joins spools and pressures is flow; spools follow their commands by the valves' delay and dynamics.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.arrays import Array
from ..machine.machine import Machine
from ..mechanics.gas_pressure import strut_pressures
from ..mechanics.plant import Plant
from ..mechanics.pose import leg_displacements
from .channels import LAYOUT, sensor_groups
from .records import sample_interval
from .signals import Band, align, differentiate, lag

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "Delay",
    "align_record",
    "combine_delays",
    "due_spools",
    "group_delays",
    "hydraulic_force",
    "oil_force",
    "phase_delay",
    "slow_delay",
]


SEGMENT = 2.0  # s: of Welch's average, Hann windows
FEWEST = 2.5  # segments: of shorter records they are shorter, as one alone is coherent with anything
NEIGHBOURS = 7  # frequencies whose coherence is judged together
RIVAL = 8.0  # of the logarithm of the likelihood: another delay as much less likely is excluded
BY_CHANCE = 4.0  # times the mean evidence for coherence of unlike noise: seven together exceed it once in 20,000
LEAKAGE = 1e-6  # of the largest power: below it a spectrum may show the window's side lobes
MOST = 1 - 1e-4  # coherence: gains and geometry that are off by 1 % make two channels as unlike as this
BAND = Band(2.0, 40.0)  # its corners [Hz] bound the frequencies that count; the lower is wide of the window's lobe


class Delay(NamedTuple):
    """Delay [s] behind `reference` and its standard error [s], from `pairs` columns of records."""

    reference: str
    delay: float
    standard_error: float
    pairs: int


def phase_delay(reference: ArrayLike, signal: ArrayLike, dt: float, band: Band = BAND) -> tuple[Array, Array]:
    """Delay (k,) of signals (n, k) behind their references and its standard error [s], from the phase's slope.

    The phase of Welch's cross-spectrum has variance (1 - C) / (2 m C) at coherence C over m segments; its slope
    through zero frequency is the least-squares one with these weights, m counted as segments that do not overlap.
    Gains and offsets do not matter. Frequencies that are no more coherent than unlike noise is by chance do not count,
    and the error is infinite where none is: each of them would determine a delay by its own phase. A delay beyond a
    tenth of a segment is not found: `signals.delay` does that.
    """
    from scipy import signal as sp

    ref, sig = (np.asarray(x, dtype=float).reshape(len(np.asarray(x)), -1) for x in (reference, signal))
    length = min(round(len(ref) / FEWEST), round(SEGMENT / dt))
    if length < 2:  # too slow a record to resolve any frequency
        return np.zeros(ref.shape[1]), np.full(ref.shape[1], np.inf)
    each = {"fs": 1 / dt, "nperseg": length, "axis": 0}
    f, cross = sp.csd(ref, sig, **each)
    power = sp.welch(ref, **each)[1] * sp.welch(sig, **each)[1]
    used = (f >= band.low) & (f <= band.high)
    if not used.any():  # too short a record to show any
        return np.zeros(ref.shape[1]), np.full(ref.shape[1], np.inf)
    omega, cross, power = 2 * np.pi * f[used, None], cross[used], power[used]
    power = np.where(power > LEAKAGE**2 * power.max(axis=0), power, 0.0)
    m = len(ref) / length
    coherence = np.divide(np.abs(cross) ** 2, power, out=np.zeros_like(power), where=power > 0)
    by_chance = _by_chance(np.minimum(coherence, MOST), (len(ref) - length // 2) // (length - length // 2))
    coherence = np.clip((m * coherence - 1) / (m - 1), 0.0, MOST)  # without the estimate's bias
    weight = np.where(by_chance, 0.0, 2 * m * coherence / (1 - coherence))
    information = np.sum(weight * omega**2, axis=0)
    error = np.divide(1.0, np.sqrt(information), out=np.full(len(information), np.inf), where=information > 0)
    delay, known = _coarse(cross, weight, omega, error)
    phase = -np.angle(cross * np.exp(1j * omega * delay))
    step = np.divide(np.sum(weight * omega * phase, axis=0), information, out=np.zeros(len(known)), where=known)
    return np.where(known, delay + step, 0.0), np.where(known, error, np.inf)


def _by_chance(coherence: Array, segments: int) -> NDArray[np.bool_]:
    """Whether unlike noise might be as coherent over so many segments, by frequency and column.

    Of noise, -(K - 1) log(1 - C) is distributed exponentially with mean one (K segments; those of Hann windows that
    overlap by half are nearly independent); it is averaged over neighbours in frequency.
    """
    from scipy.ndimage import uniform_filter1d

    evidence = -(segments - 1) * np.log1p(-coherence)
    return np.asarray(uniform_filter1d(evidence, NEIGHBOURS, axis=0, mode="constant", cval=1.0) < BY_CHANCE)


def _coarse(
    cross: NDArray[np.complex128], weight: Array, omega: Array, error: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Delay (k,) on a grid at which the weighted phases agree best, so that no phase is wrapped; whether it is known.

    It is not where another delay, farther off than four errors, explains the phases nearly as well.
    """
    top = float(omega[-1, 0])
    grid = np.arange(-0.1 * SEGMENT, 0.1 * SEGMENT, 0.5 / top)
    turned = np.exp(1j * omega * grid)  # (f, grid)
    size = np.abs(cross)
    unit = np.divide(cross, size, out=np.zeros_like(cross), where=size > 0)
    likelihood = (turned.T @ (weight * unit)).real  # its logarithm, (grid, k)
    delay = grid[np.argmax(likelihood, axis=0)]
    apart = np.abs(grid[:, None] - delay) > 4 * error + 0.5 / top
    rival = np.where(apart, likelihood, -np.inf).max(axis=0)
    return delay, np.isfinite(error) & (likelihood.max(axis=0) - rival > RIVAL)


def slow_delay(reference: ArrayLike, signal: ArrayLike, dt: float, high: float = 20.0) -> tuple[Array, Array]:
    """Delay (k,) of slow signals (n, k) and its standard error [s], by regression on the reference and its derivative.

    For small delays of what moves below the frequencies that a window resolves, and whose noise is white up to
    `high` [Hz], below which both are compared; the error is that of the residual.
    """
    band = Band(high=high)
    ref, sig = (band.apply(np.asarray(x, float).reshape(len(np.asarray(x)), -1), dt) for x in (reference, signal))
    rate = differentiate(ref, dt)
    found = []
    for x, v, y in zip(ref.T, rate.T, sig.T, strict=True):
        basis = np.stack([x - x.mean(), v, np.ones(len(x))], axis=1)
        theta = np.linalg.lstsq(basis, y, rcond=None)[0]
        variance = np.mean((y - basis @ theta) ** 2) / (2 * high * dt)  # as many values are independent
        spread = np.linalg.pinv(basis.T @ basis)[1, 1] * variance
        moves = theta[0] != 0 and spread > 0
        found.append((-theta[1] / theta[0], np.sqrt(spread) / abs(theta[0])) if moves else (0.0, np.inf))
    delay, error = np.array(found).T
    return delay, error


def combine_delays(delay: ArrayLike, error: ArrayLike) -> tuple[float, float]:
    """Mean of delays weighted by their inverse variances, and its standard error.

    Those ten times as uncertain as the best are left out: they could add a hundredth to what is known, and their
    phases may have wrapped. Where the rest scatter by more than their errors, the error is widened by that ratio.
    """
    tau, sigma = np.ravel(np.asarray(delay, float)), np.ravel(np.asarray(error, float))
    good = np.isfinite(sigma) & (sigma <= 10 * sigma.min(initial=np.inf))
    if not good.any():
        return 0.0, float("inf")
    tau, weight = tau[good], 1 / sigma[good] ** 2
    mean = float(weight @ tau / weight.sum())
    count = len(tau)
    scatter = np.sqrt(weight @ (tau - mean) ** 2 / (count - 1)) if count > 1 else 1.0
    return mean, float(max(scatter, 1.0) / np.sqrt(weight.sum()))


def group_delays(
    plant: Plant, records: "Sequence[xr.Dataset]", only: Collection[str] | None = None
) -> dict[str, Delay]:
    """Delay of every group of `channels.sensor_groups` with redundant channels, or of `only` some, over all records.

    Motion and struts are counted from `platen_displacement`, chamber pressures from `actuator_force`. A group that is
    missing here has no redundant channel in these records.
    """
    found: dict[str, tuple[str, list[Array], list[Array]]] = {}
    for record in records:
        dt = sample_interval(record)
        for group, reference, ours, theirs in _pairs(plant, record, dt):
            if only is not None and group not in only:
                continue
            _, delays, errors = found.setdefault(group, (reference, [], []))
            measure = slow_delay if group == "strut_pressure" else phase_delay  # a gas spring moves with displacement
            for values, value in zip((delays, errors), measure(theirs, ours, dt), strict=True):
                values.append(value)
    result = {}
    for group, (reference, delays, errors) in found.items():
        joined = combine_delays(np.concatenate(delays), np.concatenate(errors))
        result[group] = Delay(reference, *joined, sum(map(len, delays)))
    return result


def align_record(record: "xr.Dataset", delays: Mapping[str, Delay | float]) -> "xr.Dataset":
    """Record whose groups are advanced by their delays [s]; its attribute `aligned` lists them."""
    if not delays:
        return record
    channels, done = {}, []
    dt = sample_interval(record)
    for group, given in delays.items():
        delay = given.delay if isinstance(given, Delay) else float(given)
        behind = f" behind {given.reference}" if isinstance(given, Delay) else ""
        for name in sensor_groups()[group]:
            if name in record:
                channels[name] = record[name].copy(data=align(record[name].values, delay, dt))
                done.append(f"{name} advanced by {1e3 * delay:.4g} ms{behind}")
    before = [str(record.attrs["aligned"])] if "aligned" in record.attrs else []
    return record.assign(channels).assign_attrs(aligned="; ".join(before + done))


# ------------------------------------------------------------------------------------------------ redundant channels
def due_spools(plant: Plant, command: Array, dt: float) -> Array:
    """Spool positions (n, n_actuators) [1] that commands give: late by each valve's delay, and by its lag if any."""
    late = align(command, -plant.delays, dt)
    return lag(late, plant.lags, dt) if plant.lags.any() else late


def hydraulic_force(machine: Machine, record: "xr.Dataset") -> Array:
    """P_A A_1 - P_B A_2 (n, actuators) of the measured chamber pressures [N]; NaN where one is missing."""
    a = record["chamber_pressure_a"].reindex(actuator=list(machine.actuator_names)).values
    b = np.full((len(a), len(machine.double_acting)), np.nan)
    if "chamber_pressure_b" in record:
        b = record["chamber_pressure_b"].reindex(horizontal=list(machine.double_acting)).values
    return oil_force(machine, a, b)


def oil_force(machine: Machine, pressure_a: Array, pressure_b: Array | None = None) -> Array:
    """P_A A_1 - P_B A_2 (n, actuators) [N] of the pressures [Pa] in all chambers A, and in B if any (Eq. 4-6)."""
    force = pressure_a * np.array([a.area_a for a in machine.actuators])
    if pressure_b is not None:
        double = [a.area_b is not None for a in machine.actuators]
        force[:, double] -= pressure_b * np.array([a.area_b for a in machine.actuators if a.area_b is not None])
    return np.asarray(force, np.float64)


def _pairs(plant: Plant, record: "xr.Dataset", dt: float) -> Iterator[tuple[str, str, Array, Array]]:
    """Group, its reference, measured signals (n, k) and the signals they follow (n, k)."""
    count = plant.spools
    for name, channel in LAYOUT.items():
        if {name, channel.same_as} <= set(record.data_vars):
            yield channel.group or name, channel.same_as, record[name].values, record[channel.same_as].values
    if "platen_displacement" in record:
        base = "platen_displacement"
        pose = record[base].values
        rate = differentiate(pose, dt)
        if "platen_velocity" in record:
            yield "platen_velocity", base, record["platen_velocity"].values, rate
        if "platen_acceleration" in record:
            yield "platen_acceleration", base, record["platen_acceleration"].values, differentiate(rate, dt)
        legs, _ = leg_displacements(plant, pose)
        if "actuator_displacement" in record:
            measured = differentiate(record["actuator_displacement"].values, dt)
            yield "actuator_displacement", base, measured, differentiate(legs[:, :count], dt)
        if "strut_pressure" in record:
            gas = strut_pressures(plant.machine, legs[:, count:])
            if np.isfinite(gas).all():  # else a wrong unit of displacement leaves no length of gas
                yield "strut_pressure", base, record["strut_pressure"].values, gas
    if {"actuator_force", "chamber_pressure_a"} <= set(record.data_vars):
        force = hydraulic_force(plant.machine, record)
        whole = np.isfinite(force).all(axis=0)
        yield "chamber_pressure", "actuator_force", force[:, whole], record["actuator_force"].values[:, whole]
