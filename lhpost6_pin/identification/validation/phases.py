"""The three phases of a validation (report, Sections 6.1 to 6.3), each on one test.

    I    inverse dynamics   measured motion            -> actuator wrench that it required,  against the measured one
    II   open loop          recorded spools            -> motion, forces, chamber pressures, against the measured ones
    III  closed loop        reference and controller   -> motion and spool commands,         against the measured ones

Each phase engages more of the model: platen, struts and friction; then the oil; then the controller.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ...core.arrays import Array
from ...core.errors import LhpostError
from ...core.names import AXES
from ...simulation.rehearse import rehearse, replay
from ...simulation.simulate import fastest_engine
from ..decompose.record import take_apart
from .band_spectra import Spectrum, estimate_spectrum
from .closed_loop import Lag, drive_of, settings_of
from .metrics import ComparisonBasis
from .phase_agreement import ColumnAgreement, ComparedQuantity, agree
from .prepare_tests import PreparedTest, wrench_calibration
from .resonance import Resonance
from .simulated_phases import SimulatedComparison

__all__ = ["PHASES", "Phase", "run_phase"]


PHASES = {1: "inverse dynamics", 2: "open loop", 3: "closed loop"}

_SIDES = (
    ("wrench", "measured", "required"),
    ("struts", "struts_measured", "struts"),
    ("dissipative", "dissipative_measured", "dissipative"),
)
"""Quantities of inverse dynamics, with the names of both sides in `Decomposition`."""


@dataclass(frozen=True)
class Phase:
    """One phase of one test; without pairs, `reason` states why."""

    number: int
    test: str
    time: Array  # (n,) [s]
    pairs: tuple[ComparedQuantity, ...] = ()
    agreement: tuple[ColumnAgreement, ...] = ()
    spectrum: Spectrum | None = None
    resonances: tuple[Resonance, ...] = ()
    lags: tuple[Lag, ...] = ()  # of a closed loop behind its reference
    notes: tuple[str, ...] = ()
    reason: str | None = None

    def pair(self, quantity: str) -> ComparedQuantity | None:
        """Both sides of a quantity, if it was compared."""
        return next((p for p in self.pairs if p.quantity == quantity), None)

    def of(self, quantity: str) -> tuple[ColumnAgreement, ...]:
        """Agreement of a quantity's columns."""
        return tuple(a for a in self.agreement if a.quantity == quantity)


def run_phase(number: int, test: PreparedTest, basis: ComparisonBasis) -> Phase:
    """One phase of one test; a missing channel or a failed run becomes the phase's reason."""
    phases = {1: _inverse_dynamics, 2: _open_loop, 3: _closed_loop}
    try:
        return phases[number](test, basis)
    except LhpostError as error:
        return Phase(number, test.name, test.time, reason=str(error))


def _inverse_dynamics(test: PreparedTest, basis: ComparisonBasis) -> Phase:
    numbers, axes = basis.numbers, test.plant.axes
    columns = tuple(AXES[k] for k in axes)
    (found, notes), (again, _) = (take_apart(test.plant, one) for one in (test.test, test.again))
    calibration = wrench_calibration(test, basis.sensors)[axes]
    pairs = []
    for quantity, *sides in _SIDES:
        values = [getattr(one, side) for one in (found, again) for side in sides]
        if all(x is not None for x in values):
            measured, model, more, again_model = (numbers.band.apply(x[:, axes], test.dt) for x in values)
            sensor_noise, noise = more - measured, again_model - more - model + measured
            known = calibration if quantity == "wrench" else None
            spread = sensor_noise.std(axis=0), noise.std(axis=0)
            pairs.append(ComparedQuantity(quantity, columns, measured, model, *spread, known))
    ours, theirs, noise = (x[:, axes] for x in (found.measured, found.required, again.measured - found.measured))
    spectrum = estimate_spectrum("wrench", columns, ours, theirs, noise, test.dt, numbers)
    return Phase(1, test.name, test.time, tuple(pairs), agree(pairs, test.dt, numbers), spectrum, notes=notes)


def _open_loop(test: PreparedTest, basis: ComparisonBasis) -> Phase:
    engine = fastest_engine(test.plant)
    ran, again = (replay(test.machine, m.record, attrs={}, engine=engine) for m in (test.test, test.again))
    channels = ("actuator_force", "chamber_pressure_a", "chamber_pressure_b")
    return _of_run(2, test, SimulatedComparison(test, ran, again, basis), channels, basis)


def _closed_loop(test: PreparedTest, basis: ComparisonBasis) -> Phase:
    settings, note = settings_of(test.test.record, basis.settings)
    target, drive = drive_of(test.test.record, settings, basis.numbers.number("reference.high"))
    engine = fastest_engine(test.plant)
    ran = rehearse(test.machine, target, settings, attrs={}, drive=drive, beyond_limits=True, engine=engine)
    both = SimulatedComparison(test, ran, None, basis)
    both.notes.append(note)
    phase = _of_run(3, test, both, ("spool_command",), basis)
    velocity = phase.pair("velocity")
    assert velocity is not None
    moving = [a.column for a in phase.of("velocity") if a.moves]
    return replace(phase, lags=both.lags(target.velocity, velocity, moving))


def _of_run(
    number: int, test: PreparedTest, both: SimulatedComparison, channels: Sequence[str], basis: ComparisonBasis
) -> Phase:
    pairs = both.quantities(channels)
    found = agree(pairs, test.dt, basis.numbers)
    moving = {a.column for a in found if a.quantity == "acceleration" and a.moves}
    shown = tuple(r for r in both.resonances() if r.column in moving)
    return Phase(number, test.name, both.time, tuple(pairs), found, both.spectrum(), shown, notes=tuple(both.notes))
