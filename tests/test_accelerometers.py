"""Accelerometers on the platen: what they read, the loop that is fed by them, and the acceleration found from them."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from machine_cases import machine_named
from run_cases import amid_ridgecrest
from sensor_cases import measured

from lhpost6_pin.core.errors import ParameterError, RecordError
from lhpost6_pin.core.names import ENGINES
from lhpost6_pin.data.accelerometers import (
    WEIGHTS,
    acceleration_of_signals,
    accelerometer_channel,
    accelerometer_signals,
    with_platen_acceleration,
)
from lhpost6_pin.data.consistency import check_sensors
from lhpost6_pin.data.importing import ChannelMap, Source, TestFacts, make_imported_record
from lhpost6_pin.data.importing.raw import make_raw
from lhpost6_pin.data.records import load_record, make_record, save_record
from lhpost6_pin.data.sensors import add_noise, load_sensors, spectrum
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.accelerometers import acceleration_weights, accelerometer_rows
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import PlatenMotion, plant_motion
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.running import RunningPlant
from lhpost6_pin.simulation.simulate import ClosedLoop, simulate

SENSORS = load_sensors()
SMALL = 1e-12  # m/s2: rounding of accelerations up to 10 m/s2 and levers up to 7 m
NAMES = ("AX1", "AX2", "AY1", "AY2", "AZ1", "AZ2", "AZ3", "AZ4")


@pytest.fixture(scope="module")
def fitted():
    """The LHPOST6 with the accelerometers of its sensors file."""
    return make_plant(load_machine().with_accelerometers(SENSORS.parameters))


@pytest.fixture(scope="module")
def rows(fitted):
    return accelerometer_rows(fitted.machine.accelerometers)


@pytest.fixture(scope="module")
def motion(poses):
    rng = np.random.default_rng(3)
    return PlatenMotion(poses, *(rng.normal(size=poses.shape) * s for s in (0.3, 3.0)))


def test_readings_are_pinocchios_classical_acceleration_less_gravity(fitted, rows, motion):
    moved, g = plant_motion(fitted, motion), np.array([0.0, 0.0, -fitted.machine.platen.gravity])
    model = fitted.model.copy()
    place = [pin.SE3(np.eye(3), fitted.body[0]["rho_c"] + row[:3]) for row in rows]
    frames = [model.addFrame(pin.Frame(n, 1, 0, at, pin.OP_FRAME)) for n, at in zip(NAMES, place, strict=True)]
    data, due = model.createData(), np.zeros((len(moved.q), len(rows)))
    for k, (q, v, a) in enumerate(zip(*moved, strict=True)):
        pin.forwardKinematics(model, data, q, v, a)
        down = data.oMi[1].rotation.T @ g
        for i, (frame, row) in enumerate(zip(frames, rows, strict=True)):
            along = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL).linear
            due[k, i] = row[3:] @ (along - down + g)
    assert np.allclose(accelerometer_signals(fitted, motion, rows), due, rtol=0.0, atol=SMALL)


def test_the_platens_acceleration_is_found_again_at_any_pose_and_rate(fitted, rows, motion):
    signals = accelerometer_signals(fitted, motion, rows)
    found, _ = acceleration_of_signals(fitted, signals, rows, motion.displacement, motion.velocity)
    assert np.allclose(found, motion.acceleration, rtol=0.0, atol=SMALL)


def test_a_table_on_guides_needs_accelerometers_along_them_only():
    machine = machine_named("uniaxial")
    along = {f"accelerometer.A1.{key}": q for key, q in _first().items()}
    plant = make_plant(machine.with_accelerometers(replace(SENSORS.parameters, quantities=along)))
    rows = accelerometer_rows(plant.machine.accelerometers)
    moved = PlatenMotion(*(np.array([[x, 0, 0, 0, 0, 0]]) for x in (0.1, 0.2, 3.0)))
    signals = accelerometer_signals(plant, moved, rows)
    assert np.allclose(signals, 3.0, rtol=0.0, atol=SMALL)
    assert np.allclose(acceleration_of_signals(plant, signals, rows, *moved[:2])[0], moved.acceleration, atol=SMALL)


def _first():
    prefix = "accelerometer.AX1."
    return {p.removeprefix(prefix): q for p, q in SENSORS.parameters.items() if p.startswith(prefix)}


@pytest.mark.parametrize(
    "kept, lost",
    [
        (("AX1", "AX2", "AY1", "AY2"), "x, y, z, roll, pitch"),
        (("AX1", "AY1", "AY2", "AZ1", "AZ2", "AZ3"), ""),
        (("AX1", "AX2", "AZ1", "AZ2", "AZ3"), "y"),
    ],
)
def test_axes_that_accelerometers_do_not_determine_are_named(kept, lost, rows):
    seen = rows[[NAMES.index(name) for name in kept]]
    if lost:
        with pytest.raises(ParameterError, match=f"do not determine the platen's acceleration in .*{lost}"):
            acceleration_weights(seen, load_machine())
    else:
        assert np.isfinite(acceleration_weights(seen, load_machine())).all()


def test_axes_that_are_only_seen_together_are_named(rows):
    both = rows[[0, 0, 2, 3, 4, 5, 6, 7]]  # x and yaw by one accelerometer twice, yaw by two along y, x not apart
    both[2:4, :3] = 0.0
    with pytest.raises(ParameterError, match="in x, yaw"):
        acceleration_weights(both, load_machine())


def test_the_loop_is_fed_by_its_accelerometers_where_tilt_enters_as_acceleration(fitted, rest):
    table, roll = RunningPlant(fitted, rest), 0.01
    q = table._ws.q
    q[:] = plant_motion(fitted, PlatenMotion(*(x * np.eye(6)[3:4] for x in (roll, 0.0, 0.0)))).q[0]
    table._evaluate(table._ws, rest.spool)
    given = table.sensors().acceleration
    of_platen = record_like(fitted, table)
    weights = acceleration_weights(accelerometer_rows(fitted.machine.accelerometers), fitted.machine)
    assert np.allclose(given, weights @ of_platen[1][0], rtol=0.0, atol=SMALL)
    # y: gravity along the tilted platen, beside what the oil does to it there
    assert given[1] - of_platen[0][0, 1] == pytest.approx(fitted.machine.platen.gravity * np.sin(roll), rel=0.05)


def record_like(plant, table):
    """Acceleration (1, 6) of the platen and its readings, as a record has them."""
    from lhpost6_pin.mechanics.pose import platen_motion
    from lhpost6_pin.mechanics.schemes import A, V

    ws = table._ws
    motion = platen_motion(plant, ws.q[None], ws.motion[V][None], ws.motion[A][None])
    return motion.acceleration, accelerometer_signals(plant, motion, accelerometer_rows(plant.machine.accelerometers))


@pytest.mark.long
def test_both_engines_and_a_plant_sample_by_sample_run_alike_and_otherwise_than_with_the_platens_own(
    plant, fitted, rest
):
    controller, drive = amid_ridgecrest(plant, rest, 1024)[:2]
    runs = [simulate(fitted, ClosedLoop(controller, drive, rest), samples=1024, engine=engine) for engine in ENGINES]
    # one engine's rounding against the other's, over half a second
    assert np.allclose(runs[0].q, runs[1].q, rtol=0.0, atol=1e-9)
    own = simulate(plant, ClosedLoop(controller, drive, rest), samples=1024)
    assert 1e-7 < np.abs(runs[0].q - own.q).max() < 1e-3
    record = record_of_run(runs[0], {"test": "t"})
    assert list(record["accelerometer"].values) == list(NAMES)
    found = with_platen_acceleration(fitted, record)["platen_acceleration"]
    due = record["platen_acceleration"].values
    # tilt and rates are those of the displacement, up to 100 Hz
    assert np.abs(found.values - due).max() < 1e-3 * np.abs(due).max()


@pytest.fixture(scope="module")
def recorded(fitted, rows):
    """A record of all sensors with noise, its platen acceleration computed from accelerometers."""
    record, _ = measured(fitted, 0)
    motion = PlatenMotion(*(record[f"platen_{x}"].values for x in ("displacement", "velocity", "acceleration")))
    return noisy(fitted, rows, record, accelerometer_signals(fitted, motion, rows))


def noisy(plant, rows, record, signals):
    """The record with these readings, and noise."""
    channels = {"point_acceleration": accelerometer_channel(rows, signals)}
    record = record.drop_vars("platen_acceleration").assign(channels).assign_coords(accelerometer=list(NAMES))
    return with_platen_acceleration(plant, add_noise(record, SENSORS, np.random.default_rng(0)))


def test_the_noise_of_a_computed_acceleration_is_that_of_its_accelerometers(fitted, rows, recorded):
    true = measured(fitted, 0)[0]["platen_acceleration"].values
    error = (recorded["platen_acceleration"].values - true)[200:-200]
    f = np.linspace(0.0, 256.0, 2049)
    stated = np.sqrt(np.trapezoid(spectrum(SENSORS, recorded, "platen_acceleration", f), f, axis=0))
    assert np.allclose(error.std(axis=0) / stated, 1.0, atol=0.15)  # of some 1000 independent samples, and its tails
    assert np.allclose(recorded["platen_acceleration"].attrs[WEIGHTS][2], 0.5)  # four along z


@pytest.mark.long
def test_an_accelerometer_with_its_sign_turned_is_found_and_no_other(fitted, rows, recorded):
    fine = check_sensors(fitted, [recorded], SENSORS)
    assert {f.check for f in fine} >= {"accelerometer against displacement"}
    assert not [f for f in fine if f.verdict == "suspicious"]
    signals = recorded["point_acceleration"].values.copy()
    signals[:, 5] *= -1.0
    turned = recorded.assign(
        point_acceleration=(recorded["point_acceleration"].dims, signals, recorded["point_acceleration"].attrs)
    )
    found = check_sensors(fitted, [turned], SENSORS)
    gains = [
        f for f in found if f.check.startswith("accelerometer") and f.quantity == "gain" and f.verdict == "suspicious"
    ]
    assert [f.channel for f in gains] == ["point_acceleration[AZ2]"]
    assert gains[0].estimate == pytest.approx(-1.0, abs=0.02)  # sd of noise in 20 Hz


def test_a_record_keeps_points_and_directions_and_says_what_it_lacks(tmp_path, fitted, recorded):
    save_record(recorded, tmp_path / "t.nc")
    again = load_record(tmp_path / "t.nc")
    assert np.array_equal(
        with_platen_acceleration(fitted, again)["platen_acceleration"], recorded["platen_acceleration"]
    )
    del again["point_acceleration"].attrs["points"]
    with pytest.raises(RecordError, match=r"t\.nc: point_acceleration has no attribute points"):
        with_platen_acceleration(fitted, again)


# ----------------------------------------------------------------------------------------------- import
def imported(machine, sources, signals, dt=1 / 512):
    values = np.hstack([0.001 * np.sin(np.arange(len(signals)) * dt)[:, None] * np.ones(6), signals])
    names = (*(f"d{k}" for k in range(6)), *NAMES)
    raw = make_raw("t.csv", "csv", names, ["m"] * 3 + ["rad"] * 3 + ["g"] * 8, values, np.arange(len(values)) * dt)
    axes = ("x", "y", "z", "roll", "pitch", "yaw")
    channels = {f"platen_displacement[{axis}]": Source(column=f"d{k}") for k, axis in enumerate(axes)}
    channels |= {f"point_acceleration[{name}]": sources.get(name, Source(column=name)) for name in NAMES}
    return make_imported_record([raw], ChannelMap("map.toml", TestFacts(), channels), machine.labels, machine)


def test_import_computes_the_platens_acceleration_from_columns_with_points_in_the_map(fitted, rows, machine):
    signals = np.random.default_rng(0).normal(size=(64, 8))
    own = {
        name: Source(column=name, point=tuple(row[:3]), direction=tuple(2.0 * row[3:]))
        for name, row in zip(NAMES, rows, strict=True)
    }
    by_map, by_machine = imported(machine, own, signals), imported(fitted.machine, {}, signals)
    assert np.array_equal(by_map["platen_acceleration"], by_machine["platen_acceleration"])
    slow = acceleration_weights(rows, machine) @ (9.80665 * signals.T)
    # beside these weights only tilt enters, of at most 0.13 mrad about each axis
    assert np.allclose(by_map["platen_acceleration"].values, slow.T, rtol=0.0, atol=4e-4 * np.abs(slow).max())


@pytest.mark.parametrize(
    "source, said",
    [
        (Source(column="AX1"), r"map.toml, \[channel\] point_acceleration\[AX1\]: where is it\? add point = "),
        (Source(column="AX1", point=(0.0, 0.0, 0.0), direction=(0.0, 1.0, 0.0)), "do not determine .* yaw"),
    ],
)
def test_import_says_which_accelerometer_lacks_its_place_or_leaves_an_axis_open(fitted, rows, machine, source, said):
    own = {n: Source(column=n, point=tuple(r[:3]), direction=tuple(r[3:])) for n, r in zip(NAMES, rows, strict=True)}
    if source.point:
        own |= {n: replace(own[n], point=(0.0, 0.0, 0.0)) for n in NAMES[:4]}
    with pytest.raises(RecordError, match=said):
        imported(machine, {**own, "AX1": source}, np.zeros((64, 8)))


def test_a_sensors_file_without_accelerometers_or_with_half_of_one_is_refused(machine):
    stated = SENSORS.parameters
    with pytest.raises(ParameterError, match=r"states no accelerometers; add sections \[accelerometer.NAME\]"):
        machine.with_accelerometers(replace(stated, quantities={}))
    half = {k: q for k, q in stated.items() if k != "accelerometer.AX2.direction"}
    with pytest.raises(ParameterError, match=r"accelerometer\.AX2\.direction is missing"):
        machine.with_accelerometers(replace(stated, quantities=half))
    still = {
        **stated.quantities,
        "accelerometer.AX2.direction": replace(stated["accelerometer.AX2.direction"], value=(0.0, 0.0, 0.0)),
    }
    with pytest.raises(ParameterError, match=r"accelerometer.AX2.direction is zero"):
        machine.with_accelerometers(replace(stated, quantities=still))


def test_labels_of_a_record_name_its_accelerometers(fitted):
    signals = np.zeros((4, 8))
    record = make_record(
        np.arange(4) / 512.0,
        {"point_acceleration": accelerometer_channel(accelerometer_rows(fitted.machine.accelerometers), signals)},
        fitted.machine.labels,
        {"test": "t", "kind": "measured", "title": "t", "specimen": "none", "source": "t"},
    )
    assert list(record["accelerometer"].values) == list(NAMES)
