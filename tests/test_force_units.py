"""Forces in a wrong unit: compared with the weight and the inertia of the machine."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lhpost6_pin.core.units import parse_unit, units_of
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.force_units import wrong_force_units
from lhpost6_pin.data.records import load_record, make_record, save_record
from lhpost6_pin.data.signals import differentiate
from lhpost6_pin.machine.machine import load_machine

TABLE, GUIDED = load_machine(), load_machine("uniaxial")
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
    assert wrong_force_units(record, TABLE) == []


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
        (one,) = wrong_force_units(record.assign(actuator_force=force * np.where(those, 1e-3, 1.0)), TABLE)
        assert by in one.message and "kN taken for N" in one.message
        assert one.channel == f"actuator_force[{', '.join(map(str, force['actuator'].values[those]))}]"


def test_forces_zeroed_at_rest_are_no_other_unit():
    record = cells_only("TX")
    zeroed = record.assign(actuator_force=record["actuator_force"] - record["actuator_force"].mean("time"))
    (one,) = wrong_force_units(zeroed, TABLE)
    assert "taken for" not in one.message and "weight requires" in one.message and "zero" in one.remedy


def test_a_specimen_that_the_machine_has_not_may_make_forces_larger_but_not_smaller():
    record = cells_only("TX").assign_attrs(specimen="house")
    heavy, light = (record.assign(actuator_force=k * record["actuator_force"]) for k in (5.0, 0.2))
    assert wrong_force_units(heavy, TABLE) == [] and wrong_force_units(light, TABLE) != []
    assert wrong_force_units(heavy.assign_attrs(specimen="none"), TABLE) != []


def test_a_force_of_friction_is_not_judged_by_inertia():
    """Where friction is most of the force, what mass fits is noise: no warning, whatever the unit."""
    rubbing = guided(friction=1e6)
    assert wrong_force_units(in_unit(rubbing, "kip", "N"), GUIDED) == []


def test_the_mass_that_is_fitted_is_that_of_the_machine():
    """Without friction, force is mass times acceleration: a mass a factor four off is a warning, 2.5 is none."""
    for factor, doubted in ((4.0, True), (2.5, False), (1 / 2.5, False), (1 / 4.0, True)):
        record = guided(friction=0.0)
        off = record.assign(actuator_force=factor * record["actuator_force"])
        assert bool(wrong_force_units(off, GUIDED)) == doubted, factor


def test_import_and_check_say_it(lhpost6, tmp_path):
    save_record(in_unit(cells_only("TX"), "kip", "N"), tmp_path / "c" / "TX.nc")
    ended = lhpost6("check", "c/TX.nc")
    assert ended.code == 0 and "kip taken for N?" in ended.words
    assert lhpost6("export", "c/TX.nc", "--to", "csv").code == 0
    ended = lhpost6("import", "c/TX.csv", "--out", "again.nc")
    assert ended.code == 0 and "kip taken for N?" in ended.words
