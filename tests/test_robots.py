"""Robots of example_robot_data as specimens, and what their URDFs have that others have not."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from run_cases import at_rest

from lhpost6_pin.core.errors import ParameterError
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.derivatives import evaluate_derivatives
from lhpost6_pin.mechanics.schemes import A
from lhpost6_pin.mechanics.workspace import make_workspace
from lhpost6_pin.show.bodies import load_specimen_bodies, specimen_poses
from lhpost6_pin.simulation.simulate import OpenLoop, simulate

FAULTY = {
    "falcon.urdf": r"joint top_propeller_joint: its child link Z_propeller is not in the file; add it",
    "romeo_laas_small.urdf": r"link body: a principal moment of inertia is negative, -0\.0213 kg m2",
    "ur3.urdf": r"<robot> has no name",
}
"""Files whose faults any parser would refuse."""
WITHOUT_INERTIA = {
    "bluevolta_bravo7_gripper.urdf": "bravo_finger1_joint, bravo_finger2_joint",
    "bravo7_gripper.urdf": "bravo_finger1_joint, bravo_finger2_joint",
    "falcon_bravo7_gripper.urdf": "bravo_finger1_joint, bravo_finger2_joint",
    "icub.urdf": "neck_yaw",
    "romeo.urdf": "LFinger21",
}
"""Files with joints that move no inertia: locked alone."""


def robots() -> Path:
    import example_robot_data  # here: it takes a second to import

    return Path(example_robot_data.getModelPath("panda_description/urdf/panda.urdf"))


def mass_of(path: Path) -> float:
    return float(sum(i.mass for i in pin.buildModelFromUrdf(str(path)).inertias))


def test_every_robot_mounts_moves_and_is_drawn_or_is_refused_for_a_fault_of_its_file():
    """Locked and free: its mass on the table, a finite acceleration at rest, and bodies to draw."""
    bare, mounted = load_machine(), 0
    platen = float(sum(i.mass for i in at_rest(bare)[0].model.inertias))
    for path in sorted(robots().rglob("*.urdf")):
        for locked in (True, False):
            machine = bare.with_specimen(path, locked=locked)
            if path.name in FAULTY or (not locked and path.name in WITHOUT_INERTIA):
                message = FAULTY.get(path.name) or f"{WITHOUT_INERTIA[path.name]}.*--locked"
                with pytest.raises(ParameterError, match=rf"{path.name}: .*{message}"):
                    at_rest(machine)
                continue
            plant, rest = at_rest(machine)
            assert plant.articulated <= (not locked), path
            assert sum(i.mass for i in plant.model.inertias) == pytest.approx(platen + mass_of(path), rel=1e-12), path
            ws = make_workspace(plant, rest.state)
            assert evaluate_derivatives(plant, ws, rest.spool) == 0, path
            assert np.isfinite(ws.motion[A]).all(), path
            mounted += 1
        if path.name not in FAULTY:
            bodies = load_specimen_bodies(machine)
            assert bodies is not None and np.isfinite(specimen_poses(bodies, {}, 1)).all(), path
    assert mounted >= 100  # of the package's 77 files


JOINT = """<robot name="wheel">
  <link name="hub"><inertial><mass value="100"/>{inertia}</inertial></link>
  <link name="{wheel}"><inertial><mass value="10"/>{inertia}</inertial></link>
  <joint name="{joint}" type="{kind}">
    <parent link="hub"/><child link="{wheel}"/><axis xyz="{axis}"/><dynamics damping="{damping}"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
</robot>
"""
INERTIA = '<inertia ixx="2" iyy="2" izz="2" ixy="0" ixz="0" iyz="0"/>'


@pytest.fixture
def wheel(tmp_path):
    """URDF of a wheel on a hub."""

    def write(kind="continuous", axis="0 0 1", damping=0.0, wheel="wheel", joint="axle", inertia=INERTIA) -> Path:
        path = tmp_path / "wheel.urdf"
        numbers = {"kind": kind, "axis": axis, "damping": damping, "wheel": wheel, "joint": joint, "inertia": inertia}
        path.write_text(JOINT.format(**numbers))
        return path

    return write


def test_the_axis_of_a_joint_that_cannot_turn_means_nothing(wheel):
    plant, _ = at_rest(load_machine().with_specimen(wheel("fixed", "0 0 0")))
    assert not plant.articulated
    with pytest.raises(ParameterError, match="joint axle: its axis has no direction"):
        at_rest(load_machine().with_specimen(wheel("continuous", "0 0 0")))


@pytest.mark.parametrize("locked", [True, False])
@pytest.mark.parametrize("name", ["axle", "platen", "platen_top", "universe"])
def test_a_link_may_share_its_name_with_a_joint_or_a_part_of_the_platen(wheel, name, locked):
    plant, _ = at_rest(load_machine().with_specimen(wheel(wheel=name), locked=locked))
    assert plant.articulated != locked


def test_a_joint_with_the_platens_name_is_to_be_renamed(wheel):
    with pytest.raises(ParameterError, match=r"wheel\.urdf: .*joint names.* \(platen\); rename the specimen's"):
        at_rest(load_machine().with_specimen(wheel(joint="platen")))


def test_moments_of_inertia_may_be_negative_by_rounding_alone(wheel):
    slender = INERTIA.replace("2", "1e-20", 1)
    at_rest(load_machine().with_specimen(wheel(inertia=slender.replace("1e-20", "-1e-20"))))
    with pytest.raises(ParameterError, match=r"link hub: a principal moment of inertia is negative, -0\.001 kg m2"):
        at_rest(load_machine().with_specimen(wheel(inertia=slender.replace("1e-20", "-1e-3"))))


@pytest.mark.parametrize("rate", [1.0, 200.0, 2e3, 2e4, 2e6])
def test_damping_of_a_joint_is_what_it_is_at_any_ratio_to_the_step(wheel, rate):
    """10 kg let go on a damper: z' = -g (1 - exp(-c t)) / c, with c up to 240 a model step."""
    machine = load_machine()
    plant, rest = at_rest(machine.with_specimen(wheel("prismatic", damping=10.0 * rate)))
    run = simulate(plant, OpenLoop(np.tile(rest.spool, (512, 1)), rest.state), samples=512)
    assert run.trouble is None
    gravity = machine.platen.gravity
    velocity = gravity * np.expm1(-rate * run.time) / rate
    np.testing.assert_allclose(run.v[:, -1], velocity, rtol=0.0, atol=5e-4 * np.abs(velocity).max())  # second order
    # the first acceleration is that of rest; the platen, relieved of the weight, takes the last digits
    np.testing.assert_allclose(run.a[:, -1], -gravity * np.exp(-rate * run.time), rtol=0.0, atol=5e-3 * gravity)
