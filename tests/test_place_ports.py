"""Ports at places of the platen: against Pinocchio's placement of a point, and against the platen's own ports."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from lhpost6_pin.discovery.effect_loops import _shares_of_places
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.machine.port_names import place_of, place_port
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.port_path import ports_along
from lhpost6_pin.mechanics.pose import PlatenMotion, plant_motion
from lhpost6_pin.simulation.simulate import OpenLoop, simulate

PLACE, TURN, TILT = (6.1, 3.8, 0.2), 0.4, 0.3
MACHINE = load_machine("lhpost6")


def placed(**values):
    zero = {f"{kind}_{axis}": 0.0 for kind in ("stiffness", "damping") for axis in "xyz"}
    return MACHINE.with_effect("placed_spring", ("platen",), **{**zero, **values})


@pytest.fixture(scope="module")
def along():
    """Ports of a machine with a spring at a corner along a motion of all six axes."""
    machine = placed(stiffness_x=1e6, x=PLACE[0], y=PLACE[1], height=PLACE[2], turn=TURN, tilt=TILT)
    plant = make_plant(machine)
    t = np.arange(0.0, 1.0, 1e-3)
    wave = np.sin(2.0 * np.pi * t[:, None] * [1.0, 1.3, 0.7, 1.1, 0.9, 1.2])
    move = wave * [0.2, 0.15, 0.05, 0.02, 0.02, 0.03]
    rate = np.gradient(move, t, axis=0)
    motion = plant_motion(plant, PlatenMotion(move, rate, np.gradient(rate, t, axis=0)))
    return plant, motion, ports_along(plant, motion), t


def test_a_port_is_where_pinocchio_has_the_point_and_pulls_as_a_force_there(along):
    plant, motion, path, _ = along
    axes = [np.array(place_of(port)[1]) for port in plant.ports[-3:]]
    np.testing.assert_allclose(np.transpose(axes), pin.rpy.rpyToMatrix(0.0, TILT, TURN), atol=1e-15)
    rho = np.array(PLACE) - MACHINE.platen.centre_of_gravity
    for k in range(0, len(motion.q), 97):
        pose = pin.XYZQUATToSE3(motion.q[k])
        for i, n in enumerate(axes):
            at = n @ (pose.act(rho) - np.array(PLACE))
            assert path.s[k, i - 3] == pytest.approx(at, abs=1e-14)  # rounding of metres
            f = pose.rotation.T @ n
            np.testing.assert_allclose(path.column[k, i - 3], np.concatenate([f, np.cross(rho, f)]), atol=1e-14)


def test_forces_at_a_place_are_told_from_the_wrench_that_they_make(along):
    """Of Pinocchio's placement of three forces along the axes, whose sum is taken apart again."""
    plant, motion, path, _ = along
    ports, force = list(plant.ports[-3:]), np.random.default_rng(0).normal(0.0, 1e5, (len(motion.q), 3))
    axes = np.array([place_of(port)[1] for port in ports])
    wrench = np.zeros((len(motion.q), 6))
    for k, q in enumerate(motion.q):
        f = pin.XYZQUATToSE3(q).rotation.T @ (force[k] @ axes)
        wrench[k] = np.concatenate([f, np.cross(PLACE, f)])  # at C, on platen axes
    told = _shares_of_places(SimpleNamespace(plant=plant), ports, SimpleNamespace(ports=path))
    for i, (name, share) in enumerate(told.values()):
        np.testing.assert_allclose(np.einsum("nk,nk->n", wrench, share), force[:, i], atol=1e-7)  # rounding of 1e5
        assert name.count(",") == 2


def test_the_rate_of_a_port_is_the_derivative_of_its_coordinate(along):
    _, _, path, t = along
    rate = np.gradient(path.s[:, -3:], t, axis=0)[1:-1]
    # central differences of waves of 0.3 m at 8 rad/s, 1 ms apart: (8e-3)^2 / 6 of their rate
    np.testing.assert_allclose(path.rate[1:-1, -3:], rate, atol=4e-4 * np.abs(rate).max())


def test_a_spring_at_c_is_one_along_the_platen_s_axis():
    own = placed(stiffness_x=2e6, x=0.0, y=0.0, height=0.0, turn=0.0, tilt=0.0)
    other = MACHINE.with_effect("stray_spring", ("platen.x",), stiffness=2e6)
    spool = np.zeros((400, len(MACHINE.actuators)))
    spool[:, 0] = 0.05
    plants = [make_plant(m) for m in (own, other)]
    first, second = (simulate(p, OpenLoop(spool, p.zero_state()), samples=100) for p in plants)
    np.testing.assert_allclose(first.q, second.q, atol=1e-12)  # rounding through 400 steps


def test_names_of_places_read_back():
    assert place_of(place_port(PLACE, (0.0, 0.6, 0.8))) == (PLACE, (0.0, 0.6, 0.8))
    assert place_of("platen.x") is None
