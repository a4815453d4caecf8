"""OpenSees models on the table: masses as built, the frame by its matrices, hysteresis, and what is refused."""

import numpy as np
import pinocchio as pin
import pytest
from coupled_cases import Tower, moving, relative
from run_cases import at_rest

from lhpost6_pin.core.errors import LhpostError, SimulationError
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.coupled import BaseMotion
from lhpost6_pin.mechanics.opensees import OpenSeesSpecimen, import_opensees
from lhpost6_pin.simulation.simulate import simulate
from lhpost6_pin.simulation.specimen_response import base_wrench

try:
    ops = import_opensees()
except LhpostError as missing:
    pytest.skip(str(missing), allow_module_level=True)

FRAME = models_folder() / "specimens" / "shear_frame.py"
G = 9.80665
N = 256


def moving_base(t: float) -> BaseMotion:
    """Base that turns and translates, with the acceleration of its translation along x alone."""
    spin = pin.Motion(np.array([0.0, 0.0, 0.0, 0.3, -0.2, 0.5]))
    pose = pin.SE3(pin.rpy.rpyToMatrix(0.02, -0.03, 0.1), np.zeros(3))
    return BaseMotion(pose, spin, pin.Motion(np.array([np.sin(20.0 * t), 0.0, 0.0, 0.1, 0.4, -0.2])))


def test_a_linear_model_is_its_matrices_on_a_base_that_moves_in_all_six_components():
    """Three floors along x, y, z: exact for an acceleration linear over a step; Newmark is (w h)^2 / 12 off."""
    mass, height, k = np.array([2e4, 3e4, 1e4]), np.array([3.0, 6.0, 8.0]), 3e7 * np.ones((3, 3))
    own = Tower(mass, height, k, damping=0.0)

    def build(ops, base):
        ops.uniaxialMaterial("Elastic", 1, 3e7)
        for i, (m, h) in enumerate(zip(mass, height, strict=True), 2):
            ops.node(i, 0.0, 0.0, float(h))
            ops.mass(i, m, m, m, 0.0, 0.0, 0.0)
            ops.fix(i, 0, 0, 0, 1, 1, 1)
            below = base if i == 2 else i - 1
            axes = ("-orient", 0.0, 0.0, 1.0, 1.0, 0.0, 0.0)
            ops.element("twoNodeLink", i, below, i, "-mat", 1, 1, 1, "-dir", 1, 2, 3, *axes)

    by_opensees = OpenSeesSpecimen(build, "tower")
    assert np.allclose(sorted(np.diag(by_opensees._mass)), np.sort(np.repeat(mass, 3)))
    assert not by_opensees.interface_mass(1e-3).any()
    start, h = moving_base(0.0), 1.0 / 4096
    start = BaseMotion(start.pose, start.twist, pin.Motion.Zero())
    memory, first = by_opensees.init(start, G)
    own_memory, own_first = own.init(start, G)
    assert np.allclose(first.vector, own_first.vector, rtol=1e-9, atol=1e-3)
    found, true = [], []
    for i in range(1, 1024):
        base = moving_base(i * h)
        found.append(by_opensees.step(memory, base, h).vector)
        true.append(own.step(own_memory, base, h).vector)
    moved = np.array(true) - own_first.vector
    assert np.linalg.norm(np.array(found) - true) < 1e-3 * np.linalg.norm(moved)


def test_masses_that_ride_on_the_base_are_its_interface_mass_and_weight():
    frame = OpenSeesSpecimen(lambda ops, base: _frame()["build"](ops, base), "frame")
    own = frame.interface_mass(1e-3)
    assert own[0, 0] == 5e3 and own[1, 1] == own[2, 2] == 65e3
    assert own[5, 5] == pytest.approx(5e3 / 6 * 25 + 3 * 2e4 / 6 * 16)
    rest = BaseMotion(pin.SE3.Identity(), pin.Motion.Zero(), pin.Motion.Zero())
    assert frame.init(rest, G)[1].vector == pytest.approx([0.0, 0.0, -65e3 * G, 0.0, 0.0, 0.0], abs=1e-6)


def _frame():
    names: dict = {}
    exec(FRAME.read_text(), names)
    return names


def test_the_shipped_frame_moves_the_table_as_its_matrices_do():
    """Within 0.1 %: Newmark's period of the third mode at 10.1 Hz is (w h)^2 / 12 = 8e-5 long."""
    runs = []
    for specimen in (f"{FRAME}:build", "shear_frame"):
        plant, rest = at_rest(load_machine().with_specimen(specimen))
        runs.append(simulate(plant, moving(rest, N), samples=N))
    by_opensees, by_matrices = (run.q[:, :6] - run.q[0, :6] for run in runs)
    assert runs[0].trouble is None and relative(by_opensees, by_matrices) < 1e-3
    wrenches = [base_wrench(run) - base_wrench(run)[0] for run in runs]
    assert relative(*wrenches) < 2e-3
    assert abs(runs[0].coupling.energy_error) < 1e-3


def test_storeys_that_yield_dissipate_and_stay_below_their_strength():
    """Base shear along x of the yielding frame: at most strength, hardening and dampers; the linear one's is larger."""
    names = _frame()
    shears = {}
    for name in ("build", "build_yielding"):
        frame = OpenSeesSpecimen(names[name], name)
        rest = BaseMotion(pin.SE3.Identity(), pin.Motion.Zero(), pin.Motion.Zero())
        memory, _ = frame.init(rest, G)
        h, drift, shear = 1.0 / 2048, [], []
        for i in range(1024):
            a = 6.0 * np.sin(2 * np.pi * 2.5 * i * h)
            moved = BaseMotion(rest.pose, rest.twist, pin.Motion(np.array([a, 0, 0, 0, 0, 0])))
            total = frame.step(memory, moved, h).linear[0] + names["PLATE"] * a
            drift.append(ops.nodeDisp(11, 1))
            shear.append(total)
        shears[name] = np.array(shear)
        loop = float(np.abs(np.sum(shears[name][1:] * np.diff(drift))))
    most = np.abs(shears["build_yielding"]).max()
    assert most < np.abs(shears["build"]).max()
    assert names["YIELD"][0] < most < 2.5 * names["YIELD"][0]
    assert loop > names["YIELD"][0] * 2 * 0.006  # [J] more than one loop of twice the yield drift


@pytest.mark.parametrize(
    "build, message",
    [
        (lambda ops, base: None, "mine: the model has no free degree of freedom"),
        (lambda ops, base: ops.node(2, 0.0, 0.0, 1.0), "mine: the model has no mass"),
        (lambda ops, base: 1 / 0, "build failed: ZeroDivisionError"),
    ],
)
def test_models_that_cannot_stand_are_refused(build, message):
    with pytest.raises(SimulationError, match=message):
        OpenSeesSpecimen(build, "mine")


def test_without_opensees_the_packages_are_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "openseespy.opensees", None)
    with pytest.raises(SimulationError, match=r"pip install openseespy.*apt-get install libblas3 liblapack3"):
        import_opensees()


def test_shipped_python_specimens_are_found_by_file_name():
    machine = load_machine().with_specimen("shear_frame.py:build_yielding")
    assert machine.specimen.name == "build_yielding"
    assert load_machine().with_specimen("shear_frame.py").specimen.name == "shear_frame"
