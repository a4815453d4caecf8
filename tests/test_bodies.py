"""The machine's bodies to look at: the URDF that its numbers give, and where its joints put them."""

import numpy as np
import pinocchio as pin

from lhpost6_pin.core.files import models_folder
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.pose import rotation
from lhpost6_pin.mechanics.rigid_body import lumped_inertia
from lhpost6_pin.show.bodies import joint_positions, load_bodies
from lhpost6_pin.show.urdf import drawing_sizes, legs, urdf_text


def link_poses(bodies, machine, poses) -> dict[str, list[pin.SE3]]:
    """Placement in {s} of every link at every pose."""
    data = bodies.model.createData()
    out: dict[str, list[pin.SE3]] = {f.name: [] for f in bodies.model.frames}
    for q in joint_positions(machine, bodies.model, poses):
        pin.framesForwardKinematics(bodies.model, data, q)
        for frame, placement in zip(bodies.model.frames, data.oMf, strict=True):
            out[frame.name].append(placement.copy())
    return out


# --------------------------------------------------------------------------------------------------- URDF
def test_the_urdf_has_a_link_for_the_platen_and_for_every_barrel_and_rod(machine, bodies):
    links = {f.name for f in bodies.model.frames if f.type == pin.FrameType.BODY}
    names = [leg.name for leg in legs(machine)]
    assert len(names) == 13
    assert {"platen"} | {f"{n}_{part}" for n in names for part in ("barrel", "rod")} <= links
    assert {f"{a.name}_plate" for a in machine.actuators if a.mount == "bearing"} <= links


def test_the_shipped_urdf_is_what_the_shipped_machine_gives(machine):
    shipped = models_folder() / "lhpost6.urdf"
    assert shipped.read_text() == urdf_text(machine), "run scripts/make_urdf.py"
    assert {(q.unit, q.evidence) for q in drawing_sizes().values()} == {("1", "assumed")}
    assert pin.buildModelFromUrdf(str(shipped)).existBodyName("H1_rod")


def test_all_joints_are_zero_in_the_control_zero_position(machine, bodies):
    q = joint_positions(machine, bodies.model, np.zeros((1, 6)))[0]
    assert np.abs(q - pin.neutral(bodies.model)).max() < 1e-14  # rounding of 15 printed digits over 5 m


def test_moving_parts_and_platen_alone_compose_to_the_effective_mass_of_table_4_1(machine, bodies):
    model, data = bodies.model, bodies.model.createData()
    neutral = pin.neutral(model)
    M = pin.crba(model, data, neutral)
    M = np.triu(M) + np.triu(M, 1).T
    h = 1e-4  # central differences of lengths of order 1 m: error h^2 = 1e-8
    lever = -np.array(machine.platen.centre_of_gravity)
    G = np.zeros((model.nv, 6))  # joint rates per twist of the platen at B
    for k in range(6):
        step = h * np.eye(6)[k]  # at zero Euler angles their rates are the angular velocity
        step[:3] += np.cross(step[3:], lever)
        ends = joint_positions(machine, model, np.stack([step, -step]))
        G[:, k] = (pin.difference(model, neutral, ends[0]) - pin.difference(model, neutral, ends[1])) / (2 * h)
    alone = [machine.parameters[f"estimates.platen_alone.{what}"].value for what in ("mass", "inertia")]
    lumped = sum(lumped_inertia(*alone, machine).values())
    difference = G.T @ M @ G - lumped
    assert np.abs(difference).max() < 1e-7 * np.abs(lumped).max()
    # and so the printed first estimate, to the rounding of the table's contributions: 10 kg each
    first = machine.parameters["estimates.first.mass"].value
    np.testing.assert_allclose(np.diag(G.T @ M @ G)[:3], first, atol=30.0)


def test_bodies_stay_what_they_are_when_an_override_moves_a_swivel(machine):
    moved = machine.with_params({"H1.base_point": [10.5, 3.9, -1.3]})
    at = link_poses(load_bodies(moved), moved, np.zeros((1, 6)))["H1_barrel"][0]
    np.testing.assert_allclose(at.translation, [10.5, 3.9, -1.3], atol=1e-12)


def test_a_table_with_one_guided_actuator_has_bodies_too():
    uniaxial = load_machine("uniaxial")
    (actuator,) = uniaxial.actuators
    bodies = load_bodies(uniaxial)
    assert bodies.model.nv == 1 + 3
    at = link_poses(bodies, uniaxial, np.array([[0.1, 9.0, 9.0, 1.0, 1.0, 1.0]]))  # the guides hold all but x
    x, y, z = uniaxial.platen.centre_of_gravity
    np.testing.assert_allclose(at["platen"][0].translation, [x + 0.1, y, z], atol=1e-12)
    x, y, z = actuator.platen_point
    np.testing.assert_allclose(at[f"{actuator.name}_rod"][0].translation, [x + 0.1, y, z], atol=1e-12)


def test_any_title_makes_a_readable_urdf(machine):
    odd = machine.with_params({"machine.title": 'a -- <b> & "c" --', "machine.name": '<&">'})
    assert load_bodies(odd).model.name == '<&">'


# --------------------------------------------------------------------------------------------- kinematics
def test_rod_tips_coincide_with_the_platen_points(machine, bodies, poses):
    at = link_poses(bodies, machine, poses)
    turn = rotation(poses[:, 3:])
    for leg in legs(machine):
        if getattr(leg, "mount", "swivel") == "swivel":
            points = poses[:, :3] + turn @ np.array(leg.platen_point)
            tips = np.array([x.translation for x in at[f"{leg.name}_rod"]])
            on_platen = [x.act(np.array(leg.platen_point) - machine.platen.centre_of_gravity) for x in at["platen"]]
            assert max(np.abs(tips - points).max(), np.abs(tips - on_platen).max()) < 1e-9  # required; 1e-14 found


def test_barrels_turn_about_their_base_points_and_point_at_the_rod_tips(machine, bodies, poses):
    at = link_poses(bodies, machine, poses)
    for leg in legs(machine):
        barrels, rods = at[f"{leg.name}_barrel"], at[f"{leg.name}_rod"]
        assert max(np.abs(b.translation - leg.base_point).max() for b in barrels) < 1e-12  # rounding
        reach = np.array([b.actInv(r.translation) for b, r in zip(barrels, rods, strict=True)])
        assert np.abs(reach[:, :2]).max() < 1e-9 and reach[:, 2].min() > 0.0


def test_vertical_actuators_stay_vertical_and_their_plates_lie_in_the_bearing_plane(machine, bodies, poses):
    at = link_poses(bodies, machine, poses)
    vertical = [a for a in machine.actuators if a.mount == "bearing"]
    assert len(vertical) == 6
    for actuator in vertical:
        for k, platen in enumerate(at["platen"]):
            rod, plate = at[f"{actuator.name}_rod"][k], at[f"{actuator.name}_plate"][k]
            np.testing.assert_allclose(rod.rotation, np.eye(3), atol=1e-15)
            np.testing.assert_allclose(rod.translation[:2], actuator.base_point[:2], atol=1e-12)
            np.testing.assert_allclose(plate.rotation[:, 2], platen.rotation[:, 2], atol=1e-9)
            assert abs(plate.rotation[1, 0]) < 1e-12  # {n} does not turn about its normal: its x stays in the XZ plane
            height = platen.actInv(plate.translation)[2] + machine.platen.centre_of_gravity[2]
            assert abs(height - machine.platen.bearing_plane[2]) < 1e-9


def test_rods_stay_in_their_barrels_within_the_stroke(machine, bodies):
    shapes = {g.name: g for g in bodies.shapes}
    for actuator in machine.actuators:
        barrel, rod = shapes[f"{actuator.name}_barrel_0"], shapes[f"{actuator.name}_rod_0"]
        length = np.linalg.norm(np.subtract(actuator.platen_point, actuator.base_point))
        inner_end = rod.placement.translation[2] - rod.geometry.halfLength
        assert length + actuator.stroke + inner_end < 2 * barrel.geometry.halfLength
        assert length - actuator.stroke + inner_end >= -1e-12  # may touch the barrel's bottom
        assert rod.geometry.radius < barrel.geometry.radius
