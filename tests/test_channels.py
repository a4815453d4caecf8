"""A new sensor is one descriptor and its entries in a sensors file: a second load cell on every actuator."""

from pathlib import Path

import numpy as np
import pytest
from library_cases import shaken

from lhpost6_pin.core.files import models_folder
from lhpost6_pin.data.alignment import group_delays
from lhpost6_pin.data.channels import LAYOUT, Channel, channel_unit, sensor_groups
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.consistency import check_sensors
from lhpost6_pin.data.importing.channel_map import channels_of
from lhpost6_pin.data.records import load_record, save_record
from lhpost6_pin.data.sensors import SensorSet, load_sensors
from lhpost6_pin.identification.calibration.sensor_errors import corrected, sensor_unknowns
from lhpost6_pin.identification.prepare import AS_RECORDED, prepare_test
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.simulated_campaign import as_sensed, draw_errors

MACHINE = load_machine()
NAME = "load_cell"
CELL = Channel(
    dims=("time", "actuator"),
    units="N",
    long_name="force of a second load cell",
    residuals=("force",),
    fault="pressure_sensor_error",
    same_as="actuator_force",
)
STATED = {"noise": (2000.0, "N"), "gain_range": (0.005, "1"), "offset_range": (3000.0, "N"), "delay_range": (2e-4, "s")}


@pytest.fixture
def sensors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SensorSet:
    """The shipped sensors and the new one, its descriptor in the layout."""
    monkeypatch.setitem(LAYOUT, NAME, CELL)  # type: ignore[arg-type]
    text = (models_folder() / "sensors" / "lhpost6.toml").read_text(encoding="utf-8")
    for section, (value, unit) in STATED.items():
        entry = f'{NAME} = {{ value = {value}, unit = "{unit}", evidence = "assumed", source = "a test" }}'
        text = text.replace(f"[{section}]\n", f"[{section}]\n{entry}\n")
    path = tmp_path / "sensors.toml"
    path.write_text(text, encoding="utf-8")
    return load_sensors(path)


def test_a_channel_is_one_descriptor_and_its_entries_in_a_sensors_file(sensors: SensorSet, tmp_path: Path) -> None:
    assert sensors.noise_sd(NAME)[0] > 0.0 and sensors.delay_sd(NAME) == pytest.approx(2e-4 / np.sqrt(3))
    assert sensor_groups()[NAME] == (NAME,) and channel_unit(f"{NAME}[H1]") == "N"
    assert channels_of(MACHINE.labels)[f"{NAME}[V6]"] == (NAME, "V6")  # what a channel map can name

    rng = np.random.default_rng(1)  # a simulated test shows it, through a sensor of its own
    clean = record_of_run(shaken(MACHINE, 4096), {"test": "shaken"})
    np.testing.assert_array_equal(clean[NAME], clean["actuator_force"])
    drawn = draw_errors(clean, sensors, rng)
    record = as_sensed(clean, sensors, drawn, 1024.0, rng)
    assert np.abs(record[NAME] - record["actuator_force"]).max() > 1000.0
    path = tmp_path / "test.nc"
    save_record(record, path)
    assert load_record(path, MACHINE.labels)[NAME].attrs["units"] == "N"

    stuck = record.copy(deep=True)  # checks look at it
    stuck[NAME].values[1000:, 2] = stuck[NAME].values[1000, 2]
    assert f"{NAME}[H3]" in {f.channel for f in check_dataset(stuck) if f.severity == "warning"}

    plant = make_plant(MACHINE)  # it is aligned and compared with what it repeats
    late = group_delays(plant, [record])[NAME]
    due = drawn.delay[NAME] - drawn.delay["actuator_force"]
    assert late.reference == "actuator_force" and late.delay == pytest.approx(due, abs=5 * late.standard_error)
    found = [f for f in check_sensors(plant, [record], sensors) if f.channel == f"{NAME}[V2]"]
    assert {f.quantity for f in found} == {"gain", "delay", "offset", "residual"}
    assert all(f.verdict != "suspicious" for f in found)

    test = prepare_test(plant, record, sensors, AS_RECORDED)  # its errors are unknowns of a calibration
    unknowns = sensor_unknowns(MACHINE, sensors, test)
    own = [u.name for u in unknowns if u.channel == NAME]
    assert {f"gain {NAME}[H1]", f"offset {NAME}[V6]", f"delay {NAME}"} <= set(own) and len(own) == 21
    values = np.array([100.0 * (u.name == f"offset {NAME}[H2]") for u in unknowns])
    change = corrected(test, unknowns, values).channels[NAME] - test.channels[NAME]
    assert np.allclose(change[:, 1], -100.0) and not np.delete(change, 1, axis=1).any()
