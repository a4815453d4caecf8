"""Preparation of a campaign for a fit: checked, aligned, fused, with noisier copies of every test."""

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from ...core.errors import RecordError
from ...core.threads import by_threads
from ...data.channels import calibrated_channels, channel_name, columns_of
from ...data.layout_faults import layout_faults
from ...data.observable import observable
from ...data.records import is_measured
from ...data.sensors import SensorSet, add_noise
from ...machine.machine import Machine
from ...machine.parameters import Parameters
from ...mechanics.plant import make_plant
from ...mechanics.pose import plant_motion
from ...simulation.specimen_response import driven_wrenches
from ..friction_start import start_deviation
from ..prepare import CALIBRATION, MeasuredTest, Policy, align_records, prepare_test
from .problem import KINDS, Problem, ResidualBands
from .sensor_errors import removed_delays
from .usable_tests import too_short

__all__ = ["as_simulated", "policy_of", "prepare_problem"]

log = logging.getLogger(__name__)


def prepare_problem(
    machine: Machine,
    records: Sequence[xr.Dataset],
    sensors: SensorSet,
    numbers: Parameters,
    *,
    kinds: tuple[str, ...] = KINDS,
    others: Callable[[Machine], Sequence[Machine]] = lambda machine: (),
    seed: int = 0,
    jobs: int = -1,
) -> Problem:
    """The least-squares problem of a campaign; `numbers` are those of `models/procedures/calibration.toml`.

    `others` gives equally plausible machines (with friction of another form, with oil warmer in one test than in
    others), whose differences are noise (`Problem`). Deterministic for a seed (of the simulated noise).
    Raises what `calibrate` does.
    """
    n = numbers.number
    comparison = ResidualBands(
        numbers.vector("comparison.bands"), n("comparison.edge"), n("fit.step"), start_deviation()
    )
    _refuse(machine, records, comparison)
    _refuse_free_of_noise(machine, records, sensors)
    machine = machine.as_tested(records[0].attrs, "the first test")
    mounted, specimen = make_plant(machine), None
    if mounted.flexible:
        specimen = machine.specimen
        assert specimen is not None
        machine = replace(machine, specimen=replace(specimen, locked=True))
        log.warning(
            "%s moves on joints or in modes: its wrench along the measured motion is taken from its description, as if "
            "that were exact", specimen.name,
        )  # fmt: skip
    plant = make_plant(machine)
    policy = policy_of(numbers)
    records, delays = align_records(plant, records, policy)
    removed = removed_delays(delays, sensors)
    rng = np.random.default_rng(seed)

    def carrying(test: MeasuredTest) -> MeasuredTest:
        if specimen is None:
            return test
        moved = plant_motion(plant, test.motion)
        sways = driven_wrenches(mounted, moved, test.dt) - driven_wrenches(plant, moved, test.dt)
        return replace(test, carried=sways)

    def noisier(records: Sequence[xr.Dataset], policy: Policy) -> Iterator[MeasuredTest]:
        """Each with a draw of noise of its own; what is random is drawn in order."""
        drawn, twice = [add_noise(record, sensors, rng) for record in records], sensors.drawn_twice()
        return by_threads(lambda r: carrying(prepare_test(plant, r, twice, policy)), drawn, jobs)

    tests = list(by_threads(lambda r: carrying(prepare_test(plant, r, sensors, policy)), records, jobs))
    rougher = policy._replace(shares=False)
    noisy = [test for _ in range(int(n("fit.draws"))) for test in noisier(records, rougher)]
    exact = [not is_measured(record) for record in records]
    if any(exact):
        free = "simulated without noise; weights and intervals are those of the noise that sensors %s state"
        log.warning(f"%s: {free}", ", ".join(t.name for t, one in zip(tests, exact, strict=True) if one), sensors.name)
    # noise that a record does not have adds nothing to the normal equations, so nothing of it is subtracted
    some = [record for record, one in zip(records, exact, strict=True) if not one]
    again = []
    for _ in range(int(n("fit.corrections"))):
        draw = noisier(some, policy)
        again.append([test if one else next(draw) for test, one in zip(tests, exact, strict=True)])
    problem = Problem(
        *(machine, tests, noisy, sensors, comparison),
        again=again, jobs=jobs, kinds=kinds, others=others(machine), delays=removed,
    )  # fmt: skip
    problem.specimen = specimen
    return problem


def as_simulated(problem: Problem, machine: Machine) -> Machine:
    """A machine of a problem with the specimen that moves, if there is one, in place of the locked one."""
    return machine if problem.specimen is None else replace(machine, specimen=problem.specimen)


def policy_of(numbers: Parameters) -> Policy:
    """How records are prepared by the numbers of `models/procedures/calibration.toml`."""
    rate, cutoff, edge = (numbers.number(f"comparison.{key}") for key in ("rate", "pressure_cutoff", "edge"))
    return CALIBRATION._replace(rate=rate, pressure_cutoff=cutoff, edge=edge)


def _refuse(machine: Machine, records: Sequence[xr.Dataset], comparison: ResidualBands) -> None:
    """Raise the errors that `calibrate` lists, naming the test."""
    if not records:
        raise RecordError("the campaign has no records")
    names = [str(record.attrs.get("test", f"record {i}")) for i, record in enumerate(records, start=1)]
    for test, record in zip(names, records, strict=True):
        if faults := layout_faults(record, machine.labels):
            raise RecordError(f"{test}: {faults[0]}")
        machine.refuse_unmounted(record.attrs, test)
        _refuse_channels(test, record, machine)
        if why := too_short(record, comparison.bands, comparison.edge):
            raise RecordError(f"{test}: {why}; remove it from the campaign")
        if lacking := [c for c in calibrated_channels() if c not in record and any(c in other for other in records)]:
            what = f"{test} has no {', '.join(lacking)}, which other tests have"
            raise RecordError(f"{what}; remove that test from the campaign, or the channel from all tests")


def _refuse_free_of_noise(machine: Machine, records: Sequence[xr.Dataset], sensors: SensorSet) -> None:
    """Raise RecordError for measured channels whose noise the sensors do not state: nothing could be weighed by it."""
    lacking = []
    for name, channel in calibrated_channels().items():
        moved = [np.ptp(columns_of(r[name]), axis=0) > 0 for r in records if name in r]
        if not moved:
            continue
        moves = np.any(moved, axis=0)
        if "axis" in channel.dims:
            moves &= np.isin(np.arange(len(moves)), machine.axes)
        noise = np.broadcast_to(sensors.noise.get(name, np.zeros(1)), len(moves))
        bare = np.flatnonzero(moves & (noise == 0.0))
        each = [channel_name(records[0][name], int(i)) for i in bare]
        lacking += each if noise[moves].any() else each and [name]
    if any("valve_command" in r for r in records) and "valve_command" not in sensors.noise:
        lacking.append("valve_command (0 where it is recorded as it is given)")
    if lacking:
        what = f"sensors {sensors.name}: no noise is stated for {', '.join(lacking)}, which these tests measure"
        how = "add it to the sensors file; `lhpost6 check CAMPAIGN --sensors-out FILE` measures it"
        raise RecordError(f"{what}; {how}")


def _refuse_channels(test: str, record: xr.Dataset, machine: Machine) -> None:
    if "platen_displacement" not in record:
        why = "lengths do not replace it, since the geometry behind them is calibrated"
        raise RecordError(f"{test}: has no platen_displacement; {why}")
    if not {"actuator_force", "chamber_pressure_a", "pressure_difference"} & set(record.data_vars):
        what = "neither actuator_force nor chamber_pressure_a nor pressure_difference; give at least one of them"
        told = observable(machine, set(map(str, record.data_vars)))
        hidden, shown = (", ".join(o.quantity for o in told if (o.verdict == "no") == no) for no in (True, False))
        raise RecordError(f"{test}: has {what}. These sensors cannot tell: {hidden}; they tell: {shown or 'nothing'}")
    if "pressure_difference" in record and "chamber_pressure_a" not in record:
        if not machine.equal_areas:
            why = "of pistons whose areas differ does not determine their force"
            raise RecordError(f"{test}: pressure_difference {why}; give both chamber pressures")
    if machine.double_acting and ("chamber_pressure_a" in record) != ("chamber_pressure_b" in record):
        raise RecordError(f"{test}: has pressures of one side only; give chamber_pressure_a and chamber_pressure_b")
    if "strut_pressure" in record:
        below = np.argwhere(record["strut_pressure"].values <= 0.0)
        for sample, column in below[:1]:
            what = f"{channel_name(record['strut_pressure'], int(column))} is not above zero at sample {sample}"
            raise RecordError(f"{test}: {what}; give absolute pressures, or remove the channel from all tests")
