"""The three phases of a validation (report, Sections 6.1 to 6.3), each on one test.

    I    inverse dynamics   measured motion            -> actuator wrench that it required,  against the measured one
    II   open loop          recorded spools            -> motion, forces, chamber pressures, against the measured ones
    III  closed loop        reference and controller   -> motion and spool commands,         against the measured ones

Each phase engages more of the model: platen, struts and friction; then the oil; then the controller.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from ...control import ControllerSettings, load_controller
from ...control.filters import MODES
from ...core.arrays import Array
from ...core.errors import LhpostError, RecordError
from ...core.files import shipped
from ...core.names import AXES, SAMPLE_RATE
from ...data.quiet_spools import quiet_spools
from ...data.records import require
from ...data.signals import differentiate, resample_band_limited
from ...motions import Reference, Target
from ...simulation.rehearse import rehearse, replay
from ...simulation.simulate import fastest_engine
from ...tuning.drives import load_drive
from ..decompose.record import decompose_test
from ..friction_start import estimate_start
from ..known_slip import slip_summary
from ..prepare import source_of
from .phase_agreement import ColumnAgreement, ComparedQuantity, agree
from .prepare_tests import PreparedTest, wrench_calibration
from .simulated_phases import Lag, SimulatedComparison
from .spectra import Resonance, Spectrum, estimate_spectrum

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
    start: Array | None = None  # (n_states,) what friction held at the start, as estimated; None: it began with nothing
    slip: str = ""  # in which share of inverse dynamics friction's slip is unknown, and the error in the rest
    reason: str | None = None

    def pair(self, quantity: str) -> ComparedQuantity | None:
        """Both sides of a quantity, if it was compared."""
        return next((p for p in self.pairs if p.quantity == quantity), None)

    def of(self, quantity: str) -> tuple[ColumnAgreement, ...]:
        """Agreement of a quantity's columns."""
        return tuple(a for a in self.agreement if a.quantity == quantity)


def run_phase(number: int, test: PreparedTest) -> Phase:
    """One phase of one test; a missing channel or a failed run becomes the phase's reason."""
    phases = {1: _inverse_dynamics, 2: _open_loop, 3: _closed_loop}
    try:
        return phases[number](test)
    except LhpostError as error:
        why = str(error).removeprefix(f"{source_of(test.test.record)}: ")  # alike for all tests
        return Phase(number, test.test.name, test.time, reason=why)


def _inverse_dynamics(test: PreparedTest) -> Phase:
    numbers, axes = test.basis.numbers, test.plant.axes
    columns = tuple(AXES[k] for k in axes)
    found, notes = decompose_test(test.plant, test.test)
    again, _ = decompose_test(test.plant, test.again, found.states.z[0])
    calibration, inside = wrench_calibration(test)[axes], numbers.inside(test.test.samples, test.test.dt)
    pairs = []
    for quantity, *sides in _SIDES:
        values = [getattr(one, side) for one in (found, again) for side in sides]
        if all(x is not None for x in values):
            measured, model, more, again_model = (numbers.band.apply(x[:, axes], test.test.dt) for x in values)
            sensor_noise, noise = more - measured, again_model - more - model + measured
            known = calibration if quantity == "wrench" else None
            spread = sensor_noise[inside].std(axis=0), noise[inside].std(axis=0)
            pairs.append(ComparedQuantity(quantity, columns, measured, model, *spread, known))
    ours, theirs, noise = (x[:, axes] for x in (found.measured, found.required, again.measured - found.measured))
    spectrum = estimate_spectrum("wrench", columns, ours, theirs, noise, test.test.dt, numbers)
    ours, theirs = (numbers.band.apply(x, test.test.dt)[inside] for x in (found.measured, found.residual))
    slip = slip_summary(found.states.plant, test.test, ours, theirs, inside)
    agreement = agree(pairs, test.test.dt, numbers)
    start = found.states.z[0]
    return Phase(1, test.test.name, test.time, tuple(pairs), agreement, spectrum, notes=notes, start=start, slip=slip)


def _open_loop(test: PreparedTest) -> Phase:
    engine = fastest_engine(test.plant)
    start = None if test.plant.flexible else estimate_start(test.plant, test.test, test.basis.numbers.band.high)
    sensors = test.basis.sensors
    sides = quiet_spools(test.test.record, sensors), quiet_spools(test.again.record, sensors.drawn_twice())
    ran, again = (replay(test.plant.machine, own, attrs={}, friction=start, engine=engine) for own in sides)
    channels = ("actuator_force", "chamber_pressure_a", "chamber_pressure_b")
    return replace(_of_run(2, SimulatedComparison(test, ran, again), channels), start=start)


def _closed_loop(test: PreparedTest) -> Phase:
    settings, note = _settings_of(test.test.record, test.basis.settings)
    target, drive = _drive_of(test.test.record, settings, test.basis.numbers.number("reference.high"))
    engine = fastest_engine(test.plant)
    ran = rehearse(test.plant.machine, target, settings, attrs={}, drive=drive, beyond_limits=True, engine=engine)
    ran = ran._replace(record=_with_valve_b(test.test.record, ran.record))
    both = SimulatedComparison(test, ran, None)
    both.notes.append(note)
    if any(f"drive_{mode}" in test.test.record for mode in MODES):
        both.notes.append("driven by the recorded drive")
    phase = _of_run(3, both, ("spool_command", *(["spool_command_b"] if "spool_command_b" in ran.record else [])))
    velocity = phase.pair("velocity")
    assert velocity is not None
    moving = [a.column for a in phase.of("velocity") if a.moves]
    return replace(phase, lags=both.lags(target.velocity, velocity, moving))


def _with_valve_b(measured: xr.Dataset, ran: xr.Dataset) -> xr.Dataset:
    """A run's record with the command of servovalves B, which is that of A, where the test has it."""
    if "spool_command_b" not in measured:
        return ran
    names = [str(name) for name in measured["horizontal"].values]
    command = ran["spool_command"].sel(actuator=names).transpose("time", "actuator").values
    return ran.assign(spool_command_b=(("time", "horizontal"), command)).assign_coords(horizontal=names)


def _of_run(number: int, both: SimulatedComparison, channels: Sequence[str]) -> Phase:
    pairs, name = both.quantities(channels), both.test.test.name
    found = agree(pairs, both.dt, both.basis.numbers)
    moving = {a.column for a in found if a.quantity == "acceleration" and a.moves}
    shown = tuple(r for r in both.resonances() if r.column in moving)
    return Phase(number, name, both.time, tuple(pairs), found, both.spectrum(), shown, notes=tuple(both.notes))


def _settings_of(record: xr.Dataset, given: ControllerSettings | None) -> tuple[ControllerSettings, str]:
    """Given settings, else the shipped ones that the record's attribute `controller` names; and a note on which.

    Raises RecordError where neither is known.
    """
    name = record.attrs.get("controller")
    loop = "closed loop with the controller"
    if given is not None and name != given.name:
        named = "no controller" if name is None else f"“{name}”"
        return given, f"{loop} given, “{given.name}”; the record names {named}: settings may differ"
    known = ((file, load_controller(file)) for file in shipped("controllers"))
    settings = given or next((s for file, s in known if name in (file, s.name)), None)
    if settings is None:
        named = "no controller" if name is None else f"the controller {name!r}, which is not shipped"
        raise RecordError(f"the record names {named}; give its settings as a TOML file with --controller")
    return settings, f"{loop} that the record names, “{settings.name}”"


def _drive_of(record: xr.Dataset, settings: ControllerSettings, high: float) -> tuple[Target, Array | None]:
    """Target at the controller's rate, and the drive (n, 6) if the test replayed one.

    The drive is the recorded one (`drive_acceleration` and the like, by the mode of the reference generators), else
    that of the drive file that the record names. Velocity and acceleration of the reference are those stored, else
    low-passed derivatives up to `high` [Hz]. Raises RecordError without reference_displacement, or for a drive that is
    missing or of another mode.
    """
    modes = [mode for mode in MODES if f"drive_{mode}" in record]
    if modes and settings.mode not in modes:
        raise RecordError(f"the recorded drive is for {modes[0]} mode; {settings.name} has {settings.mode} mode")
    if not modes and "drive" in record.attrs:
        found = load_drive(Path(str(record.attrs["drive"])))
        if found.mode != settings.mode:
            raise RecordError(f"{record.attrs['drive']} is for {found.mode} mode; {settings.name} has {settings.mode}")
        return found.target, found.values
    require(record, "reference_displacement")
    time = record["time"].values - float(record["time"][0])
    dt = float(time[-1]) / (len(time) - 1)
    clock = np.arange(int(time[-1] * SAMPLE_RATE + 1e-6) + 1) / SAMPLE_RATE
    motion = [record["reference_displacement"].values]
    for name in ("reference_velocity", "reference_acceleration"):
        motion.append(record[name].values if name in record else differentiate(motion[-1], dt, high))
    x, v, a = (resample_band_limited(values, time, clock) for values in motion)
    drive = resample_band_limited(record[f"drive_{settings.mode}"].values, time, clock) if modes else None
    axes = tuple((axis, axis) for axis in AXES)
    name = str(record.attrs.get("test", "test"))
    return Target(clock, x, v, a, Reference(name, "reference of the record", 1.0, axes, 0.0, high, 0.0)), drive
