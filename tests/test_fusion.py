"""Fusion: exact without noise, as good as predicted with it, better than any sensor alone."""

import numpy as np
import pytest
from machine_cases import plant_named
from sensor_cases import RATE, measured

from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.data.fusion import fuse_motion
from lhpost6_pin.data.records import make_record
from lhpost6_pin.data.sensors import add_noise, load_sensors
from lhpost6_pin.data.signals import Band
from lhpost6_pin.identification.inverse_dynamics import march_states
from lhpost6_pin.mechanics.kinematics import pose_jacobian
from lhpost6_pin.mechanics.port_path import ports_along
from lhpost6_pin.mechanics.pose import PlatenMotion, kinematic_jacobian, plant_motion

pytestmark = pytest.mark.long

SENSORS = load_sensors()
DT = 1 / RATE
INSIDE = slice(256, -256)
MOTION = ["platen_displacement", "platen_velocity", "platen_acceleration", "actuator_displacement"]


def errors(fused, motion, band: Band) -> list[np.ndarray]:
    """Root-mean-square errors (6,) of displacement, velocity, acceleration against the truth in the band."""
    pairs = zip(fused.motion, motion, strict=True)
    return [np.sqrt(np.mean((x - band.apply(y, DT))[INSIDE] ** 2, axis=0)) for x, y in pairs]


@pytest.mark.parametrize("crossover", [None, 1.0])
def test_sensors_without_noise_give_back_the_motion(plant, crossover):
    np.testing.assert_allclose(kinematic_jacobian(plant), pose_jacobian(plant.machine, np.zeros(6)), atol=1e-12)
    record, motion = measured(plant)
    fused = fuse_motion(plant, record, SENSORS, crossover=crossover)
    for error, true in zip(errors(fused, motion, SENSORS.band), motion, strict=True):
        # the spline's integral: 1e-6 at a tenth of the sampling rate, far less at 20 of 512 Hz; ends reach in a little
        assert (error < 1e-7 * true.std(axis=0)).all()


@pytest.mark.parametrize(
    "channels",
    [
        MOTION,
        ["platen_displacement", "platen_acceleration"],
        ["actuator_displacement", "platen_acceleration"],
        ["actuator_displacement", "platen_velocity"],
        ["actuator_displacement"],
    ],
)
@pytest.mark.parametrize("crossover", [None, 2.0])
def test_errors_are_as_large_as_predicted_from_whatever_sensors_there_are(plant, channels, crossover):
    record, motion = measured(plant)
    noisy = add_noise(record[channels], SENSORS, np.random.default_rng(7))
    band = Band(high=30.0)
    fused = fuse_motion(plant, noisy, SENSORS, crossover=crossover, band=band)
    assert set(fused.used) == set(channels) - ({"platen_velocity"} if crossover and len(channels) == 4 else set())
    for order, (error, due) in enumerate(zip(errors(fused, motion, band), fused.noise, strict=True)):
        # 2 x 30 Hz x 19 s independent values know a standard deviation to 2 %; low-passed displacement errors
        # have as few as 2 x 2 Hz x 19 s: 8 %; each over 18 numbers
        np.testing.assert_allclose(error, due, rtol=0.35 if order == 0 else 0.2)


def test_fused_motion_is_better_than_each_sensor_alone_and_optimum_weights_than_a_fixed_crossover(plant):
    record, _ = measured(plant)
    noisy = add_noise(record[MOTION], SENSORS, np.random.default_rng(1))
    best = fuse_motion(plant, noisy, SENSORS).noise
    others = [fuse_motion(plant, noisy, SENSORS, crossover=c).noise for c in (0.5, 2.0, 8.0)]
    others += [fuse_motion(plant, noisy[[name]], SENSORS).noise for name in ("platen_displacement", MOTION[3])]
    for other in others:
        assert all((ours < theirs).all() for ours, theirs in zip(best, other, strict=True))
    assert (best.displacement < SENSORS.noise_sd("platen_displacement")).all()
    assert (best.velocity < SENSORS.noise_sd("platen_velocity")).all()
    assert (best.acceleration < SENSORS.noise_sd("platen_acceleration")).all()


def test_white_displacement_and_acceleration_noise_cross_over_where_their_spectra_meet(plant):
    record, _ = measured(plant)
    two = record[["platen_displacement", "platen_acceleration"]].isel(time=slice(0, 2048))
    meeting = float((SENSORS.noise["platen_acceleration"][0] / SENSORS.noise["platen_displacement"][0]) ** 0.5)
    optimum = fuse_motion(plant, two, SENSORS)
    fixed = fuse_motion(plant, two, SENSORS, crossover=meeting / (2 * np.pi))
    np.testing.assert_allclose(optimum.noise.displacement[:3], fixed.noise.displacement[:3], rtol=1e-9)
    np.testing.assert_allclose(optimum.motion.displacement[:, :3], fixed.motion.displacement[:, :3], atol=1e-12)


def test_velocity_and_acceleration_are_the_derivatives_of_the_displacement(plant):
    record, _ = measured(plant)
    fused = fuse_motion(plant, add_noise(record, SENSORS, np.random.default_rng(2)), SENSORS, band=Band(high=40.0))
    for low, high in ((0, 1), (1, 2)):
        x, v = fused.motion[low], fused.motion[high]
        stencil = (45 * (x[4:-2] - x[2:-4]) - 9 * (x[5:-1] - x[1:-5]) + (x[6:] - x[:-6])) / (60 * DT)
        error = np.sqrt(np.mean((stencil - v[3:-3])[INSIDE] ** 2, axis=0))
        assert (error < 2e-3 * v.std(axis=0)).all()  # the stencil's own: (w dt)^6 / 140 at 40 Hz, 1e-4 of what is there


def test_a_constant_error_of_an_accelerometer_does_not_reach_the_displacement(plant):
    record, motion = measured(plant)
    biased = record.assign(platen_acceleration=record["platen_acceleration"] + 0.05)
    fused = fuse_motion(plant, biased, SENSORS)
    assert (errors(fused, motion, SENSORS.band)[0] < 1e-9).all()


def test_a_guided_platen_has_its_motion_from_one_length():
    plant = plant_named("uniaxial")
    t = np.arange(2048) * DT
    x = 0.1 * np.sin(2 * np.pi * t)[:, None]
    record = make_record(t, {"actuator_displacement": x}, {"actuator": plant.machine.actuator_names}, {})
    fused = fuse_motion(plant, record, SENSORS, band=Band(high=30.0))
    axis = int(plant.axes[0])
    np.testing.assert_allclose(np.abs(fused.motion.displacement[INSIDE, axis]), np.abs(x[INSIDE, 0]), atol=1e-7)
    assert not np.delete(fused.motion.displacement, axis, axis=1).any()


def test_friction_keeps_its_memory_of_a_motion_through_a_rest(plant):
    """The platen goes 1 mm along x and rests for half a minute; seals stay as they were left."""
    t = np.arange(round(32 * RATE)) / RATE
    angle = np.pi * np.minimum(t, 1.0)
    moving = np.where(t < 1.0, 1.0, 0.0)
    x = 5e-4 * np.array([1 - np.cos(angle), np.pi * np.sin(angle) * moving, np.pi**2 * np.cos(angle) * moving])
    motion = PlatenMotion(*(np.outer(row, np.eye(6)[0]) for row in x))
    channels = dict(zip((f"platen_{name}" for name in PlatenMotion._fields), motion, strict=True))
    record = add_noise(make_record(t, channels, {}, {"kind": "simulated"}), SENSORS, np.random.default_rng(5))
    fused = fuse_motion(plant, record, SENSORS)
    seals = [k for k, name in enumerate(plant.states) if name.startswith("seal_friction.H")]

    def memory(displacement) -> np.ndarray:
        path = plant_motion(plant, motion._replace(displacement=displacement))
        return march_states(plant, ports_along(plant, path), 1 / RATE)[-1, seals]

    left = memory(motion.displacement)
    assert np.abs(left).min() > 0.9  # 1 mm is five times the seals' yield displacement
    kept, shaken = memory(fused.path), memory(fused.motion.displacement)
    assert np.abs(kept - left).max() < 0.25  # some ten um in all of ways to and fro, over a yield of 200 um
    assert np.abs(shaken - left).min() > 0.5  # which is why there is a path
    away = (t > 0.2) & (t < 0.8)  # where the platen moves the path loses nothing but noise
    assert np.abs(fused.path - motion.displacement)[away, 0].max() < 4 * fused.noise.displacement[0]


def test_what_cannot_be_fused_is_refused_by_name(plant):
    record, _ = measured(plant, duration=2.0)
    with pytest.raises(RecordError, match="neither actuator_displacement nor platen_displacement"):
        fuse_motion(plant, record[["platen_acceleration"]], SENSORS)
    holed = record.copy(deep=True)
    holed["platen_velocity"][7, 5] = np.nan
    with pytest.raises(RecordError, match=r"platen_velocity\[yaw\] at sample 7"):
        fuse_motion(plant, holed, SENSORS)


@pytest.mark.parametrize("channels", [MOTION, MOTION[:3], ["platen_displacement", "platen_velocity"]])
def test_the_shares_of_the_channels_add_up_to_the_motion(plant, channels):
    record, _ = measured(plant)
    fused = fuse_motion(plant, add_noise(record[channels], SENSORS, np.random.default_rng(3)), SENSORS, shares=True)
    assert set(fused.share) == set(fused.used) == set(channels)
    for k, whole in enumerate(fused.motion):
        total = sum(share[k] for share in fused.share.values())
        np.testing.assert_allclose(total, whole, atol=1e-9 * np.abs(whole).max())  # integrals that cancel
