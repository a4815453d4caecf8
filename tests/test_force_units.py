"""Forces in a wrong unit: compared with the weight and the inertia of the machine."""

from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.core.units import parse_unit, units_of
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.force_balance import actuator_groups, dynamic_balances
from lhpost6_pin.data.force_units import wrong_forces
from lhpost6_pin.data.records import load_record, make_record, sample_interval, save_record
from lhpost6_pin.data.rests import rest_numbers
from lhpost6_pin.data.sensors import add_noise, load_sensors
from lhpost6_pin.data.signals import Band, align, differentiate
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.actuator_forces import force_range, rest_forces
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import kinematic_jacobian
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.rehearse import rehearse

TABLE, GUIDED = load_machine(), load_machine("uniaxial")
KIP = 1.0 / 4448.2216  # of forces in kip taken for N
RECORDS = Path(__file__).parent / "data" / "records"
PRESSURES = ["chamber_pressure_a", "chamber_pressure_b", "pressure_difference", "strut_pressure", "supply_pressure"]


def cells_only(name: str) -> xr.Dataset:
    """A practice test with load cells and no pressures."""
    return load_record(RECORDS / f"practice_a_{name}.nc").drop_vars(PRESSURES, errors="ignore")


def in_unit(record: xr.Dataset, true: str, read: str) -> xr.Dataset:
    """The record as imported with a map that takes forces in one unit for those in another."""
    factor = parse_unit(read).factor / parse_unit(true).factor
    return record.assign(actuator_force=record["actuator_force"].copy(data=factor * record["actuator_force"].values))


def guided(friction: float = 2e3) -> xr.Dataset:
    """A one-axis test, forces of inertia and friction alone."""
    t = np.arange(3072) / 256.0
    x = 0.02 * np.sin(np.pi * t / t[-1]) ** 2 * (np.sin(9.0 * t) + 0.4 * np.sin(20.0 * t))
    v = differentiate(x, 1 / 256.0)
    actuator = GUIDED.actuators[0]
    along = np.sign(actuator.platen_point[0] - actuator.base_point[0])
    force = along * (GUIDED.platen.mass[0] * differentiate(v, 1 / 256.0) + friction * np.tanh(v / 1e-3))
    six = np.column_stack([x, np.zeros((len(t), 5))])
    channels = {"platen_displacement": six, "actuator_force": force[:, None]}
    return make_record(t, channels, GUIDED.labels, {"kind": "measured", "test": "one axis"})


def test_units_of_force_are_those_that_files_spell():
    assert units_of("N") == ("N", "kN", "kip", "lbf")


@pytest.mark.parametrize("name", ["TX", "WN", "EQ_ridgecrest2019_ccc"])
def test_forces_in_their_unit_are_not_doubted(name):
    record = load_record(RECORDS / f"practice_a_{name}.nc")
    assert wrong_forces(record, TABLE) == []


@pytest.mark.parametrize(
    ("true", "read", "cause"),
    [
        ("kip", "N", "kip taken for N?"),
        ("lbf", "N", "lbf taken for N or kip taken for kN?"),
        ("kN", "N", "kN taken for N or kip taken for lbf?"),
        ("N", "kip", "N taken for kip?"),
        ("lbf", "kN", "lbf taken for kN?"),
    ],
)
def test_forces_in_another_unit_are_a_warning_with_it(true, read, cause):
    for record, machine in ((cells_only("EQ_ridgecrest2019_ccc"), TABLE), (guided(), GUIDED)):
        findings = check_dataset(in_unit(record, true, read), machine)
        (one,) = [f for f in findings if f.severity == "warning" and "require" in f.message]
        assert one.message.endswith(cause) and "channel map" in one.remedy
        for name in machine.actuator_names:
            assert name in one.channel


def test_actuators_that_hold_still_are_judged_by_the_weight_and_one_that_moves_by_inertia():
    record = cells_only("TX")
    force = record["actuator_force"]
    weight = np.array([name.startswith("V") for name in force["actuator"].values])
    for those, by in ((weight, "weight requires"), (~weight, "inertia requires")):
        (one,) = wrong_forces(record.assign(actuator_force=force * np.where(those, 1e-3, 1.0)), TABLE)
        assert by in one.message and "kN taken for N" in one.message
        assert one.channel == f"actuator_force[{', '.join(map(str, force['actuator'].values[those]))}]"


def test_forces_zeroed_at_rest_are_no_other_unit():
    record = cells_only("TX")
    zeroed = record.assign(actuator_force=record["actuator_force"] - record["actuator_force"].mean("time"))
    (one,) = wrong_forces(zeroed, TABLE)
    assert "taken for" not in one.message and "weight requires" in one.message and "zero" in one.remedy


def test_a_specimen_that_the_machine_has_not_may_make_forces_larger_but_not_smaller():
    record = cells_only("TX").assign_attrs(specimen="house")
    heavy, light = (record.assign(actuator_force=k * record["actuator_force"]) for k in (5.0, 0.2))
    assert wrong_forces(heavy, TABLE) == [] and wrong_forces(light, TABLE) != []
    assert wrong_forces(heavy.assign_attrs(specimen="none"), TABLE) != []


def test_a_force_of_friction_is_not_judged_by_inertia():
    """Where friction is most of the force, what mass fits is noise: no warning, whatever the unit."""
    rubbing = guided(friction=1e6)
    assert wrong_forces(in_unit(rubbing, "kip", "N"), GUIDED) == []


@pytest.mark.parametrize(
    "true, read, words",
    [("N", "kN", "times what the actuator can give"), ("kN", "lbf", "are 1/224.8 of what inertia requires")],
)
def test_with_much_friction_only_a_size_that_cannot_be_is_doubted(true, read, words):
    """Friction about as large as inertia hid a factor of 1000; right forces, and 4.45 times these, stay undoubted."""
    rubbing = guided(friction=1.2e4)
    (one,) = wrong_forces(in_unit(rubbing, true, read), GUIDED)
    assert one.severity == "warning" and words in one.message
    assert wrong_forces(rubbing, GUIDED) == [] == wrong_forces(in_unit(rubbing, "lbf", "N"), GUIDED)


def test_the_mass_that_is_fitted_is_that_of_the_machine():
    """Without friction, force is mass times acceleration: a mass a factor four off is a warning, 2.5 is none."""
    for factor, doubted in ((4.0, True), (2.5, False), (1 / 2.5, False), (1 / 4.0, True)):
        record = guided(friction=0.0)
        off = record.assign(actuator_force=factor * record["actuator_force"])
        assert bool(wrong_forces(off, GUIDED)) == doubted, factor


def scaled(record: xr.Dataset, factor: float, actuators: tuple[int, ...]) -> xr.Dataset:
    """The record with the forces of some actuators times a factor."""
    by = np.where(np.isin(np.arange(record.sizes["actuator"]), actuators), factor, 1.0)
    return record.assign(actuator_force=record["actuator_force"] * by)


def named(actuators: tuple[int, ...]) -> str:
    return f"actuator_force[{', '.join(TABLE.actuator_names[k] for k in actuators)}]"


SINGLES, PAIRS = list(combinations(range(10), 1)), list(combinations(range(10), 2))
KINDS = [tuple(range(4)), tuple(range(4, 10)), tuple(range(10))]


@pytest.mark.parametrize("name", ["WN", "EQ_ridgecrest2019_ccc"])
@pytest.mark.parametrize("those", [*SINGLES, *PAIRS[::4], *KINDS], ids=str)
def test_every_force_in_another_unit_is_named_and_no_other(name, those):
    record = cells_only(name)
    (one,) = wrong_forces(scaled(record, KIP, those), TABLE)
    assert set(one.channel[15:-1].split(", ")) == {TABLE.actuator_names[k] for k in those}
    assert one.severity == "warning" and one.message.startswith("are 1/4448 of what")
    assert one.message.endswith("kip taken for N?")


@pytest.mark.parametrize("those", [(0,), (0, 1), (0, 1, 2, 3)], ids=str)
def test_horizontal_forces_in_another_unit_are_found_in_a_triangle_in_which_they_rub(those):
    (one,) = wrong_forces(scaled(cells_only("TX"), KIP, those), TABLE)
    assert one.channel == named(those) and one.message == "are 1/4448 of what inertia requires: kip taken for N?"


def test_a_wrong_unit_of_a_whole_kind_is_found_where_an_effect_keeps_the_balance_open():
    """As much as inertia is of a mass that sways: no hypothesis holds, but the size is a factor of thousands off."""
    record = cells_only("TX")
    force = record["actuator_force"].values.copy()
    along = kinematic_jacobian(make_plant(TABLE))[:4, 0]
    sway = Band(1.0, 20.0).apply(np.random.default_rng(0).standard_normal(len(force)), sample_interval(record))
    force[:, :4] += np.outer(50e3 * sway / sway.std(), np.sign(along))  # N, about as much as inertia
    record = record.assign(actuator_force=(record["actuator_force"].dims, force))
    assert wrong_forces(record, TABLE) == []
    (one,) = wrong_forces(scaled(record, KIP, (0, 1, 2, 3)), TABLE)
    assert one.channel == named((0, 1, 2, 3)) and one.message.endswith("kip taken for N?")


def test_horizontal_and_vertical_forces_in_two_units_are_two_findings():
    record = scaled(scaled(cells_only("WN"), KIP, KINDS[0]), 1e-3, KINDS[1])
    found = {f.channel: f.message for f in wrong_forces(record, TABLE)}
    assert set(found) == {named(KINDS[0]), named(KINDS[1])}
    assert "kip taken for N" in found[named(KINDS[0])] and "kN taken for N" in found[named(KINDS[1])]


@pytest.mark.parametrize("column", range(4, 10))
@pytest.mark.parametrize("specimen", ["none", "house"])
def test_a_vertical_force_with_its_sign_turned_is_an_error_in_a_test_along_x(column, specimen):
    """It pulls on the average, by 1.4 MN, which an actuator with one chamber cannot, whatever it bears."""
    record = scaled(cells_only("TX"), -1.0, (column,)).assign_attrs(specimen=specimen)
    errors = [f for f in check_dataset(record, TABLE) if f.severity == "error"]
    assert [f.channel for f in errors] == [named((column,))] and "sign = -1" in errors[0].remedy


def test_a_turned_sign_of_a_double_acting_actuator_is_found_by_the_weight():
    """Six equal cylinders with two chambers, at rest: the mean forces of all but one bear the table."""
    machine = load_machine("hexapod")
    plant = make_plant(machine)
    span = force_range(plant)
    due = span.middle + rest_forces(plant).share[0] * span.half
    time = np.arange(1024) / 256.0
    attrs = {"kind": "measured", "test": "rest"}
    for column in range(6):
        force = np.where(np.arange(6) == column, -1.0, 1.0) * due + np.zeros((len(time), 1))
        record = make_record(time, {"actuator_force": force}, machine.labels, attrs)
        (one,) = wrong_forces(record, machine)
        assert one.severity == "error" and one.channel == f"actuator_force[{machine.actuator_names[column]}]"


def test_one_turned_sign_is_one_error():
    """In white noise the regression on motion finds it, too."""
    record = scaled(cells_only("WN"), -1.0, (0,))
    errors = [f for f in check_dataset(record, TABLE) if f.severity == "error"]
    assert [f.channel for f in errors] == [named((0,))]


@pytest.mark.parametrize("name", ["TX", "WN", "EQ_ridgecrest2019_ccc"])
def test_errors_of_calibration_and_delays_are_no_unit_and_no_sign(name):
    """Gains 10 % off, offsets of 30 % of the load, 5 ms: no force is a factor of 4 or a sign from what is required."""
    record, rng = cells_only(name), np.random.default_rng(3)
    force = record["actuator_force"]
    signs = rng.choice([-1.0, 1.0], (8, 10))
    off = [force * (1.0 + 0.1 * sign) for sign in signs] + [
        force + 0.3 * 1.4e6 * sign * (np.arange(10) > 3) for sign in signs
    ]
    late = [force.copy(data=align(force.values, tau, sample_interval(record))) for tau in (-5e-3, 5e-3)]
    for changed in (*off, *late):
        found = wrong_forces(record.assign(actuator_force=changed), TABLE)
        assert found == []


def test_a_motion_that_contradicts_itself_accuses_no_force():
    """Acceleration in g beside a displacement in m: which of both is wrong is not known here."""
    record = scaled(cells_only("WN"), KIP, (0, 1, 2, 3))
    wrong = record.assign(platen_acceleration=record["platen_acceleration"] / 9.80665)
    assert wrong_forces(wrong, TABLE) == []
    for alone in ("platen_displacement", "platen_acceleration"):
        other = {"platen_displacement", "platen_acceleration"} - {alone}
        (one,) = wrong_forces(record.drop_vars(other), TABLE)
        assert one.channel == named((0, 1, 2, 3))


def test_the_remainder_is_that_of_the_forces_times_their_factors():
    """Of the quadratic form, against forces that were changed before: to rounding."""
    record, plant, numbers = cells_only("WN"), make_plant(TABLE), rest_numbers()
    force = record["actuator_force"].values
    factor = np.random.default_rng(1).uniform(-2.0, 2.0, 10)
    for one, other in zip(
        dynamic_balances(record, plant, force, numbers),
        dynamic_balances(record, plant, force * factor, numbers),
        strict=True,
    ):
        np.testing.assert_allclose(one.remainder(factor), other.remainder(np.ones(10)), rtol=1e-9)


def test_actuators_that_act_on_axes_of_their_own_are_judged_apart():
    for name, sizes in (("lhpost6", [4, 6]), ("hexapod", [6]), ("biaxial", [1, 1]), ("uniaxial", [1])):
        groups = actuator_groups(make_plant(load_machine(name)))
        assert [int(g.actuators.sum()) for g in groups] == sizes, name


def noisy(record: xr.Dataset, seed: int = 1) -> xr.Dataset:
    """The record with the noise of the LHPOST6's sensors."""
    return add_noise(record, load_sensors("lhpost6"), np.random.default_rng(seed))


@cache
def sine(axis: str, amplitude: float, period: float) -> xr.Dataset:
    """A simulated sine in closed loop, one model step a sample, recorded at 256 Hz."""
    motion = find_motion("sine", axis=axis, amplitude=amplitude, period=period, cycles=4.0)
    options = {"engine": "fused", "steps_per_second": SAMPLE_RATE, "record_every": 8}
    target = make_target(motion, rate=float(SAMPLE_RATE))
    return rehearse(TABLE, target, load_controller("lhpost6"), attrs={"test": "sine"}, **options).record


@pytest.mark.parametrize("period", [1.0, 1.5, 2.0, 2.2, 2.5, 3.0, 4.0])
@pytest.mark.parametrize(("axis", "amplitude"), [("x", 0.05), ("x", 0.1), ("x", 0.15), ("y", 0.05), ("y", 0.1)])
def test_right_forces_of_a_slow_sine_are_not_doubted(axis, amplitude, period):
    """Near 0.5 Hz inertia and struts almost cancel, and friction is most of the forces in the band of the balance.

    With noise, forces of 0.1 m in 2 s were 4.448 times what inertia requires, but for friction as large as that.
    """
    for record in (sine(axis, amplitude, period), noisy(sine(axis, amplitude, period))):
        assert wrong_forces(record, TABLE) == []


@pytest.mark.parametrize(
    ("axis", "amplitude", "period"),
    [
        ("z", 0.03, 1.5),
        ("z", 0.05, 2.0),
        ("z", 0.08, 4.0),
        ("roll", 0.01, 2.0),
        ("pitch", 0.01, 2.0),
        ("yaw", 0.03, 4.0),
    ],
)
def test_right_forces_of_a_slow_sine_along_another_axis_are_not_doubted(axis, amplitude, period):
    assert wrong_forces(sine(axis, amplitude, period), TABLE) == []


@pytest.mark.parametrize(("axis", "amplitude", "period"), [("x", 0.1, 1.0), ("x", 0.02, 0.25), ("y", 0.02, 0.25)])
@pytest.mark.parametrize(("true", "read"), [("kip", "N"), ("kN", "N"), ("lbf", "N"), ("N", "lbf")])
def test_another_unit_of_horizontal_forces_is_found_in_a_fast_sine(axis, amplitude, period, true, read):
    """Of the kind that moves: inertia is well above friction."""
    record = noisy(sine(axis, amplitude, period))
    factor = parse_unit(read).factor / parse_unit(true).factor
    (one,) = wrong_forces(scaled(record, factor, KINDS[0]), TABLE)
    assert one.channel == named(KINDS[0]) and f"{true} taken for {read}" in one.message


def test_import_and_check_say_it(lhpost6, tmp_path):
    save_record(in_unit(cells_only("TX"), "kip", "N"), tmp_path / "c" / "TX.nc")
    ended = lhpost6("check", "c/TX.nc")
    assert ended.code == 0 and "kip taken for N?" in ended.words
    assert lhpost6("export", "c/TX.nc", "--to", "csv").code == 0
    ended = lhpost6("import", "c/TX.csv", "--out", "again.nc")
    assert ended.code == 0 and "kip taken for N?" in ended.words
